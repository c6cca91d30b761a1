//! A finding on trial: does it predict data it has not seen, blocks of the record and an attitude left out, and does the same with
//! its regressors shifted in time, a placebo, score as well?
//!
//! Nonlinear parameters stay as fitted; amplitudes are fitted anew to what is not left out. It decides nothing.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::DVector;

use super::answer::HeldOut;
use super::axes::add_regressor;
use super::design::{Chosen, Column, Frame, Normal, Raw};
use super::model::entry_columns;
use super::noise::{AxisNoise, Schedule};
use super::scene::{Axes, Scene};
use super::search::{self, Entry, Set};
use crate::math::rms::rms_about_mean;
use crate::math::shared_work;
use crate::physics::Mat3;

/// Lengths of the blocks that are held out in turn, s: the longest of which each half of the record has its share of the effect.
const BLOCKS_S: [f64; 4] = [21_600.0, 10_800.0, 5400.0, 2700.0];
/// That share, of the whitened energy.
const SHARE: f64 = 0.2;
/// Share of the energy of a part that its prediction may be expected to miss, for the part to be predictable.
const PREDICTABLE: f64 = 0.5;
/// A miss that is as likely by chance, if the set is right, counts as the one expected.
const BY_CHANCE: f64 = 0.05;
/// Fewest windows that can be left out, or fitted to.
const WINDOWS_MIN: usize = 50;
/// Shortest hold that counts as an attitude, s, and the angle within which it is one, rad: a deadband is narrower.
const HOLD_S: f64 = 5400.0;
const SAME_ATTITUDE_RAD: f64 = 0.35;
/// Shifts of a placebo, as shares of the record, and the share of the finding's energy that a placebo may imitate.
const SHIFTS: [f64; 7] = [0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875];
const PLACEBO_SHARE: f64 = 0.5;

/// What a trial showed.
#[derive(Debug, Clone)]
pub struct Tried {
    /// Each half of alternate blocks, predicted from the other.
    pub blocks: HeldOut,
    /// Share of the effect predicted in those halves of which the other can say more than half, but for what chance misses; none where
    /// they have too little of it:
    /// of a step between two blocks, each has nothing but a constant.
    pub confirmed: Option<f64>,
    /// Each attitude, predicted from all others; none where there is but one.
    pub attitudes: Option<HeldOut>,
    /// Log evidence above that of the best placebo; none where every shift imitates the set.
    pub above_placebo: Option<f64>,
}

/// A claimed set on trial.
pub struct Trial<'a> {
    scene: &'a Scene<'a>,
    frame: &'a Frame,
    set: &'a Set,
    noise: &'a [AxisNoise; 3],
    /// The fitted series of the set.
    signal: Axes,
    /// Its columns over the whole record, and the prior size of those that are linear.
    series: Vec<(Raw, Option<f64>)>,
}

/// A part of the record, as a case of its own.
struct Part {
    index: Vec<usize>,
    frame: Frame,
}

/// How the record is divided: the part of each window that is left out in turn (none for windows that never are), and the block it
/// is in, over which a standard error is taken.
struct Division {
    scheme: String,
    part: Vec<Option<usize>>,
    block: Vec<usize>,
}

fn pick(series: &[f64], index: &[usize]) -> Vec<f64> {
    index.iter().map(|i| series[*i]).collect()
}

impl<'a> Trial<'a> {
    /// Of a set at its noise; `frame` is of that noise.
    pub fn new(
        scene: &'a Scene<'a>,
        frame: &'a Frame,
        entries: &'a [Entry],
        set: &'a Set,
        noise: &'a [AxisNoise; 3],
    ) -> Self {
        let left = search::residual(scene, frame, entries, set);
        let signal = std::array::from_fn(|k| scene.residual_ng[k].iter().zip(&left[k]).map(|(a, b)| a - b).collect());
        let mut series = Vec::new();
        for m in &set.members {
            let Some(raws) = entry_columns(scene, &entries[m.entry], &m.theta) else { continue };
            for j in 0..m.linear().max(1) {
                let place = m.axis.unwrap_or(j);
                let size = (m.linear() > 0).then(|| m.scale * entries[m.entry].usual_size(place));
                // At the windows alone: a trial is by what they say.
                let mut raw = raws[place].clone();
                raw.iter_mut().flatten().for_each(|series| series.truncate(scene.schedule.len()));
                series.push((raw, size));
            }
        }
        Self { scene, frame, set, noise, signal, series }
    }

    /// All of it.
    pub fn tried(&self) -> Tried {
        let placebo = || if self.set.members.is_empty() { None } else { self.above_placebo() };
        let attitudes = || if self.set.members.is_empty() { None } else { self.attitudes() };
        let ((blocks, confirmed), (attitudes, above_placebo)) =
            shared_work::both(|| self.blocks(), || shared_work::both(attitudes, placebo));
        Tried { blocks, confirmed, attitudes, above_placebo }
    }

    /// Predicts each half of alternate blocks from the other; and the share predicted where it could be.
    fn blocks(&self) -> (HeldOut, Option<f64>) {
        let whitened = self.frame.column(&self.signal.clone().map(Some), 1.0);
        let mut energy = vec![0.0; self.scene.schedule.len()];
        for k in 0..3 {
            energy.iter_mut().zip(whitened.projected(k, self.frame)).for_each(|(sum, x)| *sum += x * x);
        }
        let total: f64 = energy.iter().sum();
        let share = |division: &Division| {
            let even = energy.iter().zip(&division.part).filter(|(_, part)| **part == Some(0)).map(|(e, _)| e);
            let even = even.sum::<f64>() / total.max(1e-300);
            even.min(1.0 - even)
        };
        let divisions = BLOCKS_S.map(|length_s| Division::blocks(self.scene.clock_s(), length_s));
        let fair = divisions.iter().position(|division| share(division) >= SHARE);
        let fairest = (0..divisions.len()).max_by(|a, b| share(&divisions[*a]).total_cmp(&share(&divisions[*b])));
        self.predict_each(&divisions[if total > 0.0 { fair.or(fairest).unwrap_or(0) } else { 0 }])
    }

    /// Predicts each attitude from all others; `None` where there is but one.
    fn attitudes(&self) -> Option<HeldOut> {
        Division::attitudes(self.scene).map(|division| self.predict_each(&division).0)
    }

    /// Log evidence of the set's own regressors above that of the best placebo; `None` where every shift imitates it.
    fn above_placebo(&self) -> Option<f64> {
        let on_signal = self.frame.with_data(&self.signal);
        let energy = on_signal.data.dot(&on_signal.data);
        let n = self.scene.schedule.len();
        let evidence = |linear: &[Column], fixed: &[Column]| {
            Chosen::new(self.frame, linear.iter().collect(), &fixed.iter().collect::<Vec<&Column>>()).log_evidence
        };
        let (linear, fixed) = self.shifted(0);
        let own = evidence(&linear, &fixed);
        let placebo = |share: &f64| {
            let (linear, fixed) = self.shifted((share * n as f64) as usize);
            let imitated = 2.0 * Chosen::new(&on_signal, Vec::new(), &[]).normal(&linear).explained();
            (imitated < PLACEBO_SHARE * energy).then(|| own - evidence(&linear, &fixed))
        };
        SHIFTS.iter().filter_map(placebo).reduce(f64::min)
    }

    /// Whitened columns of the set, shifted in time by so many windows: linear ones and those of fixed amplitude.
    fn shifted(&self, windows: usize) -> (Vec<Column>, Vec<Column>) {
        let turn = |series: &[f64]| -> Vec<f64> {
            let n = series.len();
            (0..n).map(|i| series[(i + n - windows) % n]).collect()
        };
        self.columns(self.frame, &turn)
    }

    /// The columns of the set as `seen` of the whole record, whitened: linear ones and those of fixed amplitude.
    fn columns(&self, frame: &Frame, seen: &dyn Fn(&[f64]) -> Vec<f64>) -> (Vec<Column>, Vec<Column>) {
        let (mut linear, mut fixed) = (Vec::new(), Vec::new());
        for (raw, size) in &self.series {
            let column = frame.column(&raw.each_ref().map(|s| s.as_deref().map(seen)), size.unwrap_or(1.0));
            if size.is_some() { linear.push(column) } else { fixed.push(column) }
        }
        (linear, fixed)
    }

    fn part(&self, index: Vec<usize>) -> Part {
        let shared = self.scene.schedule.shared_ng.each_ref();
        let shared = shared.map(|axis| axis.iter().map(|series| pick(series, &index)).collect());
        let mut schedule = Schedule::new(&pick(self.scene.clock_s(), &index)).with_shared(shared);
        schedule.slow_seen = self.scene.schedule.slow_seen;
        let sub = |axes: &Axes| -> Axes { std::array::from_fn(|k| pick(&axes[k], &index)) };
        let loudness = self.scene.loudness.each_ref().map(|axis| axis.pick(&index));
        let frame = Frame::new(self.noise, &schedule, &loudness, &sub(&self.scene.residual_ng));
        Part { frame, index }
    }

    fn predict_each(&self, division: &Division) -> (HeldOut, Option<f64>) {
        let n = self.scene.schedule.len();
        let mut after: Axes = self.scene.residual_ng.clone();
        let (mut signal_energy, mut missed_energy, mut gain) = (0.0, 0.0, 0.0);
        // The same of parts that the others can predict.
        let (mut predictable, mut unpredicted) = (0.0, 0.0);
        // Of the blocks that hold a window: one that lies in a hole says nothing.
        let mut block_gain: BTreeMap<usize, f64> = BTreeMap::new();
        let parts: Range<usize> = 0..division.part.iter().flatten().max().map_or(0, |last| last + 1);
        for left_out in parts {
            let (test, train): (Vec<usize>, Vec<usize>) = (0..n).partition(|i| division.part[*i] == Some(left_out));
            if train.len() < WINDOWS_MIN || test.len() < WINDOWS_MIN {
                continue;
            }
            let (train, test) = (self.part(train), self.part(test));
            let (on_train, on_test) = (self.on(&train), self.on(&test));
            gain += on_train.normal.and(&on_test.normal).gain(1.0) - on_train.normal.gain(1.0) + on_test.of_fixed;
            let predicted = self.predict(&on_train.normal.posterior().0);
            let whiten =
                |axes: &Axes| test.frame.column(&std::array::from_fn(|k| Some(pick(&axes[k], &test.index))), 1.0);
            let (p, s) = (whiten(&predicted), whiten(&self.signal));
            let missed = s.less(&p, 1.0);
            let signal = s.dot(&s);
            signal_energy += signal;
            missed_energy += missed.dot(&missed);
            let expected = on_train.normal.expected_miss(&on_test.normal);
            if expected.energy < PREDICTABLE * signal {
                let missed = s.less(&whiten(&self.predict(&on_train.normal.free_mean())), 1.0);
                let missed = missed.dot(&missed);
                predictable += signal;
                unpredicted += if expected.chance(missed) > BY_CHANCE { missed.min(expected.energy) } else { missed };
            }
            let left = test.frame.data.less(&p, 1.0);
            for k in 0..3 {
                // The constant goes with the amplitudes: both are those of the other parts.
                let beside = |i: &usize| self.scene.residual_ng[k][*i] - predicted[k][*i];
                let constant = train.index.iter().map(beside).sum::<f64>() / train.index.len() as f64;
                let (b, a) = (test.frame.data.projected(k, &test.frame), left.projected(k, &test.frame));
                for (place, i) in test.index.iter().enumerate() {
                    *block_gain.entry(division.block[*i]).or_default() += 0.5 * (b[place].powi(2) - a[place].powi(2));
                    after[k][*i] -= predicted[k][*i] + constant;
                }
            }
        }
        let count = block_gain.len() as f64;
        let mean = block_gain.values().sum::<f64>() / count;
        let spread = block_gain.values().map(|g| (g - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let held = HeldOut {
            scheme: division.scheme.clone(),
            before_rms_ng: std::array::from_fn(|k| rms_about_mean(&self.scene.residual_ng[k])),
            after_rms_ng: std::array::from_fn(|k| rms_about_mean(&after[k])),
            excess_removed: if signal_energy > 0.0 { 1.0 - missed_energy / signal_energy } else { 0.0 },
            log_score_gain: gain,
            log_score_gain_se: Some((spread * count).sqrt()).filter(|error| count > 1.0 && *error > 0.0),
        };
        let whole = self.frame.with_data(&self.signal).data;
        let is_enough = predictable > 0.0 && predictable >= SHARE * whole.dot(&whole);
        (held, is_enough.then(|| 1.0 - unpredicted / predictable))
    }

    /// The set on a part of the record.
    fn on(&self, part: &Part) -> OnPart {
        let (linear, fixed) = self.columns(&part.frame, &|series| pick(series, &part.index));
        let beside = Chosen::new(&part.frame, Vec::new(), &fixed.iter().collect::<Vec<&Column>>());
        OnPart { normal: beside.normal(&linear), of_fixed: beside.log_evidence }
    }

    /// The set's series over the whole record with amplitudes in units of their priors, as a part of it has them.
    fn predict(&self, amplitudes: &DVector<f64>) -> Axes {
        let mut sum: Axes = std::array::from_fn(|_| vec![0.0; self.scene.schedule.len()]);
        let mut amplitudes = amplitudes.iter();
        for (raw, size) in &self.series {
            add_regressor(&mut sum, raw, size.map_or(1.0, |size| size * amplitudes.next().unwrap_or(&0.0)));
        }
        sum
    }
}

/// A set on a part of the record.
struct OnPart {
    normal: Normal,
    /// Log evidence of its members of fixed amplitude.
    of_fixed: f64,
}

impl Division {
    fn blocks(clock_s: &[f64], length_s: f64) -> Self {
        let block: Vec<usize> = clock_s.iter().map(|t| ((t - clock_s[0]) / length_s) as usize).collect();
        let part = block.iter().map(|block| Some(block % 2)).collect();
        Self { scheme: format!("alternate {} h blocks", length_s / 3600.0), part, block }
    }

    /// Every attitude a part, `None` where there are not two of them.
    fn attitudes(scene: &Scene) -> Option<Self> {
        let clock_s = scene.clock_s();
        let holds = holds(scene);
        let mut refs: Vec<Hold> = Vec::new();
        let mut part = vec![None; clock_s.len()];
        for hold in holds.into_iter().filter(|hold| hold.span_s[1] - hold.span_s[0] >= HOLD_S) {
            let known = refs.iter().position(|other| other.is_as(&hold)).unwrap_or(refs.len());
            for (t, part) in clock_s.iter().zip(&mut part) {
                if (hold.span_s[0]..=hold.span_s[1]).contains(t) {
                    *part = Some(known);
                }
            }
            if known == refs.len() {
                refs.push(hold);
            }
        }
        let block = clock_s.iter().map(|t| ((t - clock_s[0]) / BLOCKS_S[1]) as usize).collect();
        (refs.len() > 1).then(|| Self { scheme: format!("each of {} attitudes left out", refs.len()), part, block })
    }
}

/// A span in which the attitude is held, in inertial axes, in those of the orbit, or in both for as short as it is.
struct Hold {
    span_s: [f64; 2],
    /// Body from inertial axes, and body from those of the orbit, where it began.
    held: [Option<Mat3>; 2],
}

impl Hold {
    fn is_as(&self, other: &Hold) -> bool {
        self.held
            .iter()
            .zip(&other.held)
            .any(|pair| matches!(pair, (Some(a), Some(b)) if angle_rad(a, b) < SAME_ATTITUDE_RAD))
    }
}

fn angle_rad(a: &Mat3, b: &Mat3) -> f64 {
    ((a.transpose() * b).trace() / 2.0 - 0.5).clamp(-1.0, 1.0).acos()
}

fn holds(scene: &Scene) -> Vec<Hold> {
    let mut holds: Vec<Hold> = Vec::new();
    for (g, t) in scene.grid_s.iter().enumerate() {
        let up = scene.r_m[g].normalize();
        let across = scene.r_m[g].cross(&scene.v_m_s[g]).normalize();
        let orbit = Mat3::from_columns(&[across.cross(&up), across, up]);
        let now = [scene.body[g], scene.body[g] * orbit];
        let still = |held: &Option<Mat3>, now: &Mat3| held.filter(|held| angle_rad(held, now) < SAME_ATTITUDE_RAD);
        if let Some(hold) = holds.last_mut() {
            let held = [still(&hold.held[0], &now[0]), still(&hold.held[1], &now[1])];
            if held.iter().any(Option::is_some) {
                hold.span_s[1] = *t;
                hold.held = held;
                continue;
            }
        }
        holds.push(Hold { span_s: [*t, *t], held: now.map(Some) });
    }
    holds
}
