//! Does something ring after instants that recur? What manoeuvres, the edges of the shadow, or entries of the log set swinging begins
//! with the same phase each time, as noise that resonates does not: the rings are added up before they are squared.
//!
//! Instants that recur at even distances are a comb, whose teeth are narrower than any one ring, and noise that resonates may lie under a tooth:
//! rings are so far apart that any noise has forgotten its phase from one to the next, and where it is known to remember it some of it counts.

use std::f64::consts::TAU;

use rustfft::num_complex::Complex64;

use super::Remains;
use super::grid::Tapered;
use super::parts::{APART, Beside, LENGTH, Oscillation, Parts};
use crate::diagnose::answer::Interval;
use crate::diagnose::case::WINDOW_STRIDE_S;
use crate::diagnose::instants::Recurring;
use crate::diagnose::noise::FORGOTTEN_S;
use crate::math::shared_work;

/// Power beside white noise, all axes together, from which on a line is weighed: one line of white noise in seventy has as much.
const WORTH_WEIGHING: f64 = 8.0;

/// Most instants after which something may ring: what happens oftener happens all the time.
const OFTEN: usize = 64;

/// What rings, in what time it dies away, s, and after what.
type Ringing<'a> = (Oscillation, f64, &'a Recurring);

/// The least probable ringing after any of the recurring instants.
pub(super) fn ringing(
    parts: &[Parts],
    scale_ng: [f64; 3],
    noise: Beside,
    first_s: f64,
    recurring: &[Recurring],
) -> Option<Remains> {
    let of_each = shared_work::map(parts, |parts| {
        let seldom = recurring.iter().filter(|after| after.at_s.len() <= OFTEN);
        let rings = seldom.filter_map(|after| Rings::new(parts, first_s, after));
        rings.map(|rings| rings.least_probable(noise)).collect::<Vec<(usize, Option<Ringing>)>>()
    });
    let trials: usize = of_each.iter().flatten().map(|(trials, _)| trials).sum();
    let found = of_each.into_iter().flatten().filter_map(|(_, found)| found);
    let (found, decay_s, Recurring { what, at_s }) = found.reduce(first_least)?;
    let form = format!(
        "a ringing after every {what}, its period about {:.0} s, dying away in about {decay_s:.0} s",
        found.period_s
    );
    let location = format!("after every {what}, {} of them", at_s.len());
    let rings = |at: &f64| Interval { start_s: *at, end_s: at + APART as f64 * decay_s, why: "it rings".into() };
    Some(found.remains(trials, scale_ng, (form, location), at_s.iter().map(rings).collect()))
}

fn first_least<'a>(best: Ringing<'a>, next: Ringing<'a>) -> Ringing<'a> {
    if next.0.log_tail < best.0.log_tail { next } else { best }
}

/// The parts of a record that begin at instants that recur.
struct Rings<'p, 'a> {
    parts: &'p Parts<'p>,
    after: &'a Recurring,
    /// Each, how late it begins after its instant, s, and how much is left by then; none of them reaches the next.
    all: Vec<(Tapered, f64, f64)>,
    /// Energy of their tapers.
    energy: f64,
    /// Parts without a ring, and how sure they are.
    others: Vec<&'p Tapered>,
    sure_as: f64,
}

impl<'p, 'a> Rings<'p, 'a> {
    /// `None` where they leave no room for parts without, or where fewer than two were recorded.
    fn new(parts: &'p Parts, first_s: f64, after: &'a Recurring) -> Option<Self> {
        let all: Vec<f64> = after.at_s.iter().map(|t| (t - first_s) / WINDOW_STRIDE_S).collect();
        let [long, near] = [LENGTH, APART].map(|decays| (decays * parts.decay) as f64);
        let away = |part: &&Tapered| all.iter().all(|place| (part.from as f64 - place).abs() > near);
        let others: Vec<&Tapered> = parts.all.iter().filter(away).collect();
        let sure_as = Parts::sure_as(others.len())?;
        // What follows before a ring has died away is a part of it; and noise must have forgotten its phase.
        let mut places: Vec<f64> = Vec::new();
        for place in &all {
            if places.last().is_none_or(|last| place - last >= long.max(FORGOTTEN_S / WINDOW_STRIDE_S)) {
                places.push(*place);
            }
        }
        let ring = |place: f64| {
            let part = parts.at(place.ceil().max(0.0) as usize)?;
            let late = part.from as f64 - place;
            Some((part, late * WINDOW_STRIDE_S, (-late / parts.decay as f64).exp()))
        };
        let all: Vec<(Tapered, f64, f64)> = places.into_iter().filter_map(ring).collect();
        let energy = all.iter().map(|(part, _, left)| left * left * part.energy).sum();
        (all.len() > 1).then_some(Self { parts, after, all, energy, others, sure_as })
    }

    /// How many lines were looked at, and the least probable.
    fn least_probable(&self, noise: Beside) -> (usize, Option<Ringing<'a>>) {
        let kept = if let Beside::Usual { memory_s } = noise { memory_s.map(|s| self.kept(s)) } else { [1.0; 3] };
        let of_line = |i: usize| {
            let power = self.power(i);
            let loud = self.mean_square(i);
            let alone: [f64; 3] = std::array::from_fn(|k| power[k] / loud[k].max(1.0) / kept[k]);
            (alone.iter().sum::<f64>() >= WORTH_WEIGHING).then(|| {
                let others = (&self.others[..], self.sure_as);
                (self.parts.oscillation(i, (power, alone), others, noise), self.parts.decay_s(), self.after)
            })
        };
        let lines = self.parts.lines.len();
        (lines, (0..lines).filter_map(of_line).reduce(first_least))
    }

    /// Power on each axis of a line, all rings added up, each turned back by its phase since its instant: of white noise, 1 in the mean.
    fn power(&self, i: usize) -> [f64; 3] {
        let rate_rad_s = TAU / self.parts.period_s(i);
        let mut sum = [Complex64::ZERO; 3];
        for (part, late_s, left) in &self.all {
            let turned = Complex64::from_polar(left * part.energy.sqrt(), -rate_rad_s * late_s);
            sum.iter_mut().enumerate().for_each(|(k, sum)| *sum += turned * part.line(k, i));
        }
        sum.map(|x| x.norm_sqr() / self.energy)
    }

    /// Mean square on each axis in these parts beside that in the whole record, without that of a line.
    fn mean_square(&self, i: usize) -> [f64; 3] {
        let energy: f64 = self.all.iter().map(|(part, ..)| part.energy).sum();
        let of = |k: usize| self.all.iter().map(move |(part, ..)| part.energy * part.beside(k, part.power(k, i)));
        std::array::from_fn(|k| of(k).sum::<f64>() / energy)
    }

    /// How many times the power of one ring all of them together may have of noise that keeps its phase for so long: at even distances it may
    /// have the same in each.
    fn kept(&self, memory_s: f64) -> f64 {
        if memory_s == 0.0 {
            return 1.0;
        }
        let mut sum = 0.0;
        for (a, ..) in &self.all {
            for (b, ..) in &self.all {
                let apart_s = a.from.abs_diff(b.from) as f64 * WINDOW_STRIDE_S;
                sum += (a.energy * b.energy).sqrt() * (-apart_s / memory_s).exp();
            }
        }
        sum / self.all.iter().map(|(part, ..)| part.energy).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::super::grid::Grid;
    use super::super::grid::tests::{clock, coloured, resonant, white};
    use super::super::parts::of_all_decays;
    use super::*;
    use crate::diagnose::scene::Axes;

    const MEMORY_S: f64 = 4000.0;

    /// Instants at no even distance, the same in every record, and one every orbit.
    fn recurring() -> [Recurring; 2] {
        let at_s = [9_000.0, 31_700.0, 52_300.0, 68_100.0, 94_900.0, 111_300.0];
        let changes = Recurring { what: "change".into(), at_s: at_s.map(|t| 1000.0 + t).to_vec() };
        let orbit = (0..22).map(|i| 3000.0 + 5440.0 * f64::from(i)).collect();
        [changes, Recurring { what: "orbit".into(), at_s: orbit }]
    }

    fn found(clock: &[f64], axes: &Axes, memory_s: f64) -> Option<Remains> {
        let noise = Beside::Usual { memory_s: [memory_s; 3] };
        let grid = Grid::new(clock, axes)?;
        ringing(&of_all_decays(&grid), [1.0; 3], noise, clock[0], &recurring())
    }

    #[test]
    fn rings_that_are_faint_each_are_found_together() {
        let clock = clock(5000);
        let mut found_in = 0;
        for seed in 0..20 {
            let mut axes = white(seed, clock.len());
            // Each of SNR 5: half a square amplitude of 1.1 over half a decay time, 40 windows.
            for at in &recurring()[0].at_s {
                for (i, t) in clock.iter().enumerate().filter(|(_, t)| *t > at) {
                    let since = t - at;
                    axes[2][i] += 1.1 * (-since / 2000.0).exp() * (TAU * since / 650.0 + 1.0).sin();
                }
            }
            let Some(found) = found(&clock, &axes, 0.0) else { continue };
            let right = found.probability < 1e-5 && found.axis == "mostly z" && found.intervals.len() == 6;
            found_in += usize::from(right && (found.period_s.unwrap() / 650.0 - 1.0).abs() < 0.1);
        }
        assert!(found_in >= 19, "{found_in} of 20");
    }

    /// Fifteen records of each kind: white, with three times the power of the noise fitted about a period of 1500 s, resonating about one of
    /// 906 s, a sixth of an orbit's, or half as loud again after every instant. A probability below a ten-thousandth has one chance in 160 among
    /// all.
    #[test]
    fn noise_does_not_ring_whether_even_or_not() {
        let clock = clock(5000);
        for seed in 0..15 {
            let mut louder = white(seed, clock.len());
            for (i, t) in clock.iter().enumerate() {
                let is_after = recurring()[0].at_s.iter().any(|at| (0.0..2000.0).contains(&(t - at)));
                louder.iter_mut().for_each(|axis| axis[i] *= if is_after { 1.5 } else { 1.0 });
            }
            let narrow = resonant(2_000 + seed, clock.len(), 4.0, 5440.0 / 6.0, MEMORY_S);
            for (axes, memory_s) in [
                (white(1_000 + seed, clock.len()), 0.0),
                (coloured(seed, clock.len(), 1.4), 0.0),
                (narrow, MEMORY_S),
                (louder, 0.0),
            ] {
                let probability = found(&clock, &axes, memory_s).map_or(1.0, |found| found.probability);
                assert!(probability > 1e-4, "{seed}: {probability}");
            }
        }
    }
}
