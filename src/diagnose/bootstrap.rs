//! The bootstrap of the maximum statistic: records of nothing but the fitted noise and the errors that all windows share, each
//! through the whole search with the noise fitted anew.
//!
//! Two things make it cheap. Most replicates are nowhere near what is asked about, and a first look at the noise they were made
//! with tells: every entry alone, which needs no fit of the noise and no filter of its own. And where many reach what is asked
//! about, few replicates say so: they end with the fifth that does (Besag and Clifford 1991, sequential Monte Carlo p-values).
//! Not here: what the probability decides (see `analysis`).

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::design::Frame;
use super::noise::{self, AxisNoise};
use super::scene::{Measured, Scene};
use super::search::{self, Bank, Set};
use super::solve::{Library, Solution, null_noise, solve};
use crate::math::shared_work;

/// Log posterior odds by which the whole search may exceed the first look, since it joins effects, fits the noise anew and
/// marginalises its slow part. In 240 replicates of four records, two of them with slow noise, it exceeded it by 3.8 at most, by 2.4
/// in one of a hundred; a slow test looks again.
pub const REACH: f64 = 5.0;
/// Replicates that reach what is asked about, with which the bootstrap ends: of 999 the probability is then a two-hundredth at least, far
/// from what a claim needs, and known to a half of itself.
const ENOUGH: usize = 5;
/// Replicates between two looks at whether that is so.
const BATCH: usize = 32;

/// What the replicates say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reached {
    /// Probability that a record of noise alone scores as high.
    pub probability: f64,
    /// The least that so many replicates could have shown.
    pub least: f64,
}

/// What all replicates of a case share.
pub struct Bootstrap<'a> {
    scene: &'a Scene<'a>,
    library: &'a Library,
    noise: [AxisNoise; 3],
    seed: u64,
    frame: Frame,
    bank: Bank<'a>,
    /// Statistic that is asked about, less what is no proof; replicates have noise as fitted, and owe it nothing.
    asked: f64,
}

impl<'a> Bootstrap<'a> {
    /// Replicates of `noise` at the windows of a scene, to be compared with a statistic.
    pub fn new(scene: &'a Scene<'a>, library: &'a Library, noise: [AxisNoise; 3], seed: u64, asked: f64) -> Self {
        let frame = Frame::new(&noise, &scene.schedule, &scene.loudness, &scene.residual_ng);
        let bank = Bank::new(&frame, library.searched());
        Self { scene, library, noise, seed, frame, bank, asked }
    }

    /// Runs replicates, `count` at most; `done` hears of each. The same, however many processors share them.
    pub fn run(&self, count: usize, done: impl Fn() + Sync + Send) -> Reached {
        let mut reached = 0;
        let least = 1.0 / (count + 1) as f64;
        for first in (0..count).step_by(BATCH) {
            let batch: Vec<usize> = (first..count.min(first + BATCH)).collect();
            let reaches = shared_work::map(&batch, |i| {
                let reaches = self.reaches(*i);
                done();
                reaches
            });
            for (i, reaches) in batch.iter().zip(reaches) {
                reached += usize::from(reaches);
                if reached == ENOUGH {
                    return Reached { probability: ENOUGH as f64 / (i + 1) as f64, least };
                }
            }
        }
        Reached { probability: (reached + 1) as f64 * least, least }
    }

    /// Whether replicate `index` reaches what is asked about.
    fn reaches(&self, index: usize) -> bool {
        let measured = self.noise_alone(index);
        self.first_look(&measured) + REACH >= self.asked && self.searched(measured).statistic() >= self.asked
    }

    /// The first look at replicate `index`, and all that the search finds in it.
    pub fn look_and_solution(&self, index: usize) -> (f64, Solution) {
        let measured = self.noise_alone(index);
        (self.first_look(&measured), self.searched(measured))
    }

    fn searched(&self, measured: Measured) -> Solution {
        let scene = self.scene.with_measured(measured);
        solve(&scene, self.library, null_noise(&scene, Some(&self.noise)))
    }

    fn noise_alone(&self, index: usize) -> Measured {
        let mut rng =
            rand_chacha::ChaCha8Rng::seed_from_u64(self.seed.wrapping_mul(1_000_003).wrapping_add(index as u64));
        let schedule = &self.scene.schedule;
        let residual_ng = std::array::from_fn(|k| {
            let mut normal = || StandardNormal.sample(&mut rng);
            let mut noise = noise::simulate(&self.noise[k], schedule, &self.scene.loudness[k], &mut normal);
            for error in &schedule.shared_ng[k] {
                let size: f64 = normal();
                noise.iter_mut().zip(error).for_each(|(x, error)| *x += size * error);
            }
            noise
        });
        let flips = schedule.flips.each_ref().map(|flips| flips.drawn(|| StandardNormal.sample(&mut rng)));
        Measured { residual_ng, flips }
    }

    /// The best log posterior odds of an entry alone, at the noise of the bootstrap.
    fn first_look(&self, measured: &Measured) -> f64 {
        let frame = self.frame.with_measured(measured);
        let nothing = Set::default();
        let chosen = nothing.chosen(&frame);
        let seen = self.bank.before(&frame.data);
        (0..self.library.searched().len())
            .map(|i| search::best_of_entry(&seen, i, &chosen).0)
            .fold(f64::NEG_INFINITY, f64::max)
    }
}
