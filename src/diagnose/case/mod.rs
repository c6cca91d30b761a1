//! A case, read from its texts and checked. Not here: files (the command reads them), and what other kinds of recording hold.

mod air;
mod check;
mod fitted_law;
mod frozen;
mod header;
mod motion;
mod read;
mod spikes;

use std::collections::BTreeMap;
use std::ops::Deref;
use std::sync::Arc;

pub use fitted_law::FittedLaw;
pub use header::{Files, Header, KEYS, NEEDED, Vehicle};
pub use motion::unresolved;
pub use spikes::SPIKE;

use super::error::CaseError;
use super::measure::{fourth_difference, is_even};
use crate::math::shared_work;
use crate::pipeline::calibration::AnomalyKind;

/// Windows a recording must have in common with its simulation, fewer say nothing about the noise.
pub const WINDOWS_MIN: usize = 200;
/// Half of the window the recorder averages over, s.
pub const HALF_WINDOW_S: f64 = 25.0;
/// From the centre of one window to that of the next, s.
pub const WINDOW_STRIDE_S: f64 = 25.0;

/// Kinds of entries of the log that are tried as a cause: each takes some 30 ms and 6 MB, and is a chance for noise that the tables of
/// nulls, made with five kinds, do not hold.
pub const KINDS_TRIED: usize = 32;

/// The texts of the files a case names.
#[derive(Debug, Clone, Default)]
pub struct Texts {
    /// `recording.csv`.
    pub recording: Option<String>,
    /// `simulation.csv`.
    pub simulation: Option<String>,
    /// `ancillary.csv`.
    pub ancillary: Option<String>,
    /// `events.csv`; a case without a log is allowed.
    pub events: Option<String>,
}

/// Calibrated windows.
#[derive(Debug, Clone, Default)]
pub struct Recording {
    /// Window centres, increasing.
    pub clock_s: Vec<f64>,
    /// Acceleration in body axes, one vector per axis.
    pub a_ng: [Vec<f64>; 3],
    /// Average deviation in the window.
    pub dev_ng: [Vec<f64>; 3],
    /// What the calibration leaves open, per axis: series whose true sizes are independent and standard normal, ng.
    pub bias_errors_ng: [Vec<Vec<f64>>; 3],
    /// The same of its scale factors, as shares of the value.
    pub scale_errors: [Vec<Vec<f64>>; 3],
    /// The bias laws that were fitted to the dump itself, per axis: what they take from a bias of the sensor.
    pub bias_laws: [Vec<FittedLaw>; 3],
    /// What was wrong with the instrument, as far as its own dump tells.
    pub faults: Vec<Fault>,
    /// What did not come of the frames of a dump, in words; `None` where all did.
    pub not_come: Option<String>,
}

/// A fault of the instrument that the calibration found in a dump.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Which.
    pub kind: AnomalyKind,
    /// When, instrument clock.
    pub span_s: [f64; 2],
    /// One sentence an operator understands.
    pub sentence: String,
    /// The instrument answered it as it is meant to, by a coarser range.
    pub answered: bool,
}

/// What the baseline simulation expects, instantaneous.
#[derive(Debug, Clone, Default)]
pub struct Simulation {
    /// Grid, increasing.
    pub clock_s: Vec<f64>,
    /// Acceleration in body axes, one vector per axis.
    pub a_ng: [Vec<f64>; 3],
}

/// Orbit, attitude and environment on their grid.
#[derive(Debug, Clone, Default)]
pub struct Ancillary {
    /// Grid, increasing.
    pub clock_s: Vec<f64>,
    /// Inertial position (true equator of date).
    pub r_m: Vec<[f64; 3]>,
    /// Inertial velocity.
    pub v_m_s: Vec<[f64; 3]>,
    /// Body from inertial, scalar first.
    pub q: Vec<[f64; 4]>,
    /// Inertial rate in body axes.
    pub w_rad_s: Vec<[f64; 3]>,
    /// Density the simulation used.
    pub density_kg_m3: Vec<f64>,
    /// Sensor temperature.
    pub temperature_c: Vec<f64>,
}

/// One entry of the mission log.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Start, instrument clock.
    pub clock_s: f64,
    /// Duration.
    pub duration_s: f64,
    /// Kind.
    pub kind: String,
    /// Anything.
    pub detail: String,
}

/// What a recording is compared with, checked: a case that lacks its recording.
#[derive(Debug, Clone)]
pub struct Expectation {
    /// `case.toml`.
    pub header: Header,
    /// The simulation.
    pub simulation: Simulation,
    /// The ancillary data.
    pub ancillary: Ancillary,
    /// The mission log, in order of time.
    pub events: Vec<Event>,
}

/// A checked `acceleration_csv` case: every window lies inside simulation and ancillary data.
#[derive(Debug, Clone)]
pub struct Case {
    /// What the recording is compared with.
    pub expected: Arc<Expectation>,
    /// The recording.
    pub recording: Recording,
    /// Windows of the span asked for that are before or after the simulation or the ancillary data.
    pub windows_beyond: usize,
    /// Windows left out because simulation or ancillary data have a hole there.
    pub windows_in_holes: usize,
    /// Windows left out because the simulation's grid is too coarse for its own signal there.
    pub windows_too_rough: usize,
    /// Windows left out because they stand alone, far out of what is before and after them.
    pub windows_of_spikes: usize,
    /// Windows left out because an axis repeats itself there.
    pub windows_frozen: usize,
}

impl Deref for Case {
    type Target = Expectation;

    fn deref(&self) -> &Expectation {
        &self.expected
    }
}

impl Expectation {
    /// From its parts, units checked.
    ///
    /// # Errors
    /// The first unit that cannot be right.
    pub fn new(
        header: Header,
        simulation: Simulation,
        ancillary: Ancillary,
        mut events: Vec<Event>,
    ) -> Result<Self, CaseError> {
        check::simulation(&header.files.simulation, &simulation)?;
        check::ancillary(&header.files.ancillary, &ancillary)?;
        check::drag(&header.files.ancillary, &header.vehicle, &ancillary)?;
        air::agrees(&header.files.ancillary, &header, &ancillary)?;
        events.sort_by(|a, b| a.clock_s.total_cmp(&b.clock_s));
        Ok(Self { header, simulation, ancillary, events })
    }

    /// From the texts of its files, of which a recording is not one.
    ///
    /// # Errors
    /// What is wrong with each of the files.
    pub fn from_texts(header: Header, texts: &Texts) -> Result<Self, Vec<CaseError>> {
        let files = header.files.clone();
        let simulation = || {
            let simulation = read::simulation(&files.simulation, read::given(&files.simulation, &texts.simulation)?)?;
            check::simulation(&files.simulation, &simulation).map(|()| simulation)
        };
        let ancillary = || {
            let ancillary = read::ancillary(&files.ancillary, read::given(&files.ancillary, &texts.ancillary)?)?;
            check::ancillary(&files.ancillary, &ancillary).map(|()| ancillary)
        };
        let (simulation, ancillary) = shared_work::both(simulation, ancillary);
        let events = read::log(&files.events, &texts.events);
        match (simulation, ancillary, events) {
            (Ok(simulation), Ok(ancillary), Ok(events)) => {
                Self::new(header, simulation, ancillary, events).map_err(|error| vec![error])
            }
            (simulation, ancillary, events) => {
                let errors = [simulation.err(), ancillary.err(), events.err()].into_iter().flatten();
                Err(errors.map(|error| read::placed(error, &files, texts)).collect())
            }
        }
    }

    /// Kinds of entries in the log, in order.
    pub fn kinds(&self) -> Vec<&str> {
        let mut kinds: Vec<&str> = self.events.iter().map(|e| e.kind.as_str()).collect();
        kinds.sort_unstable();
        kinds.dedup();
        kinds
    }

    /// The kinds that are tried as a cause, in order: those with most entries, [`KINDS_TRIED`] at most. Of a log with a kind to every entry
    /// each would be another chance for noise.
    pub fn kinds_tried(&self) -> Vec<&str> {
        let mut count: BTreeMap<&str, usize> = BTreeMap::new();
        for event in &self.events {
            *count.entry(&event.kind).or_default() += 1;
        }
        let mut kinds: Vec<(&str, usize)> = count.into_iter().collect();
        kinds.sort_by_key(|(_, entries)| std::cmp::Reverse(*entries));
        kinds.truncate(KINDS_TRIED);
        kinds.sort_unstable();
        kinds.into_iter().map(|(kind, _)| kind).collect()
    }

    /// Events of one kind as spans `[start_s, end_s]`.
    pub fn spans(&self, kind: &str) -> Vec<[f64; 2]> {
        self.events.iter().filter(|e| e.kind == kind).map(|e| [e.clock_s, e.clock_s + e.duration_s]).collect()
    }
}

impl Case {
    /// From the texts of its files.
    pub fn from_texts(header: Header, texts: &Texts) -> Result<Self, CaseError> {
        let files = &header.files;
        let read = || {
            let recording = read::recording(&files.recording, read::given(&files.recording, &texts.recording)?)?;
            check::recording(&files.recording, &recording).map(|()| recording)
        };
        let recording = read().map_err(|error| read::placed(error, files, texts))?;
        Self::of(header, recording, texts)
    }

    /// From a recording that has been read, and the texts of the other files.
    ///
    /// # Errors
    /// The first that is wrong; a recording of too few windows.
    pub fn of(header: Header, recording: Recording, texts: &Texts) -> Result<Self, CaseError> {
        read::increasing(&header.files.recording, &recording.clock_s, WINDOWS_MIN)?;
        let expected = Expectation::from_texts(header, texts).map_err(first)?;
        Self::meet(Arc::new(expected), recording)
    }

    /// From its parts: units checked, and windows outside simulation, ancillary data or the span asked for left out.
    pub fn new(
        header: Header,
        recording: Recording,
        simulation: Simulation,
        ancillary: Ancillary,
        events: Vec<Event>,
    ) -> Result<Self, CaseError> {
        Self::meet(Arc::new(Expectation::new(header, simulation, ancillary, events)?), recording)
    }

    /// A recording and what it is compared with: its unit checked, and windows outside simulation, ancillary data or the span
    /// asked for left out.
    ///
    /// # Errors
    /// When the unit cannot be right, or too little is in common.
    pub fn meet(expected: Arc<Expectation>, recording: Recording) -> Result<Self, CaseError> {
        let files = &expected.header.files;
        check::recording(&files.recording, &recording)?;
        let common = |grid: &[f64]| [grid[0] + HALF_WINDOW_S, grid[grid.len() - 1] - HALF_WINDOW_S];
        let mut kept = recording;
        let asked = within(&kept, expected.header.span_s).clock_s.len();
        for (file, span) in [
            ("case.toml", expected.header.span_s),
            (&files.simulation, common(&expected.simulation.clock_s)),
            (&files.ancillary, common(&expected.ancillary.clock_s)),
        ] {
            let [first, last] = [kept.clock_s[0], kept.clock_s[kept.clock_s.len() - 1]];
            kept = within(&kept, span);
            if kept.clock_s.len() < WINDOWS_MIN {
                return Err(CaseError::NoOverlap {
                    recording_start_s: first,
                    recording_end_s: last,
                    file: file.to_string(),
                    start_s: span[0],
                    end_s: span[1],
                    common: kept.clock_s.len(),
                    needed: WINDOWS_MIN,
                });
            }
        }
        let windows_beyond = asked - kept.clock_s.len();
        check::recording(&files.recording, &kept)?;
        let coarse = |file: &str, kept: &Recording| {
            let common = kept.clock_s.len();
            let coarse = CaseError::TooCoarse { file: file.into(), step_s: STEP_MAX_S, common, needed: WINDOWS_MIN };
            if common < WINDOWS_MIN { Err(coarse) } else { Ok(()) }
        };
        let before = kept.clock_s.len();
        for (file, grid) in
            [(&files.simulation, &expected.simulation.clock_s), (&files.ancillary, &expected.ancillary.clock_s)]
        {
            kept = outside_holes(&kept, grid);
            coarse(file, &kept)?;
        }
        let windows_in_holes = before - kept.clock_s.len();
        let in_common = kept.clock_s.len();
        let (smooth, stretches) = smooth_enough(&kept, &expected.simulation);
        kept = smooth;
        let common = kept.clock_s.len();
        let needed = if stretches > ROUGH_STRETCHES_MAX { (SMOOTH_SHARE * in_common as f64) as usize } else { 0 };
        let needed = needed.max(WINDOWS_MIN);
        if common < needed {
            return Err(CaseError::TooRough { file: files.simulation.clone(), common, needed });
        }
        let windows_too_rough = before - windows_in_holes - kept.clock_s.len();
        let [windows_frozen, windows_of_spikes] = [frozen::without, spikes::without].map(|without| {
            let (before, alike) = (kept.clock_s.len(), without(&kept));
            if alike.clock_s.len() >= WINDOWS_MIN {
                kept = alike;
            }
            before - kept.clock_s.len()
        });
        Ok(Self {
            expected,
            recording: kept,
            windows_beyond,
            windows_in_holes,
            windows_too_rough,
            windows_of_spikes,
            windows_frozen,
        })
    }
}

fn first(mut errors: Vec<CaseError>) -> CaseError {
    errors.swap_remove(0)
}

fn within(recording: &Recording, span: [f64; 2]) -> Recording {
    let keep: Vec<usize> = (0..recording.clock_s.len())
        .filter(|&i| recording.clock_s[i] >= span[0] && recording.clock_s[i] <= span[1])
        .collect();
    take(recording, &keep)
}

fn take(recording: &Recording, keep: &[usize]) -> Recording {
    let pick = |v: &Vec<f64>| keep.iter().map(|&i| v[i]).collect::<Vec<f64>>();
    Recording {
        clock_s: pick(&recording.clock_s),
        a_ng: std::array::from_fn(|k| pick(&recording.a_ng[k])),
        dev_ng: std::array::from_fn(|k| pick(&recording.dev_ng[k])),
        bias_errors_ng: recording.bias_errors_ng.each_ref().map(|axis| axis.iter().map(pick).collect()),
        scale_errors: recording.scale_errors.each_ref().map(|axis| axis.iter().map(pick).collect()),
        bias_laws: recording.bias_laws.each_ref().map(|axis| axis.iter().map(|law| law.at(keep)).collect()),
        faults: recording.faults.clone(),
        not_come: recording.not_come.clone(),
    }
}

/// Longest step of a grid across which anything is compared, s: over longer ones gravity gradient and attitude bend too much for
/// a straight line.
const STEP_MAX_S: f64 = 150.0;

/// The windows no part of which is in a step of the grid that is longer than [`STEP_MAX_S`].
fn outside_holes(recording: &Recording, grid: &[f64]) -> Recording {
    let holes: Vec<&[f64]> = grid.windows(2).filter(|step| step[1] - step[0] > STEP_MAX_S).collect();
    let touches = |t: f64| {
        let next = holes.partition_point(|hole| hole[1] <= t - HALF_WINDOW_S);
        holes.get(next).is_some_and(|hole| hole[0] < t + HALF_WINDOW_S)
    };
    let keep: Vec<usize> = (0..recording.clock_s.len()).filter(|i| !touches(recording.clock_s[*i])).collect();
    take(recording, &keep)
}

/// Share of the noise by which what is taken between grid points may miss the simulated signal.
const ROUGHNESS_MAX: f64 = 0.3;

/// Rough stretches up to which a simulation is rough there alone: eight changes of attitude, each turned by one push and stopped by
/// another, leave fewer; a deadband leaves some fifty to four hundred.
const ROUGH_STRETCHES_MAX: usize = 30;
/// Share of the windows that must be smooth where there are more of them: as many firings again may lie between two rows and show in none.
const SMOOTH_SHARE: f64 = 0.9;

/// What may be missed of a series between the grid points beside point `i`, where a cubic goes through every four (see
/// [`super::measure`]): an eighth of a jump, a quarter of what only one point has, a twelfth of a bend, and of what is smooth hardly
/// anything. Where steps differ that is an eighth of a bend, as if straight lines went from point to point. Nothing is known of it at the ends.
fn missed(grid: &[f64], series: &[f64], i: usize) -> f64 {
    if i == 0 || i + 1 == grid.len() {
        return 0.0;
    }
    let [before, after] = [grid[i] - grid[i - 1], grid[i + 1] - grid[i]];
    if i > 1 && i + 2 < grid.len() && is_even(&grid[i - 2..i + 3]) {
        return fourth_difference(&series[i - 2..i + 3]).abs() / 24.0;
    }
    let straight = (series[i - 1] * after + series[i + 1] * before) / (before + after);
    (series[i] - straight).abs() * before.max(after).powi(2) / (4.0 * before * after)
}

/// The windows in which the simulation's grid resolves its own signal, and how many stretches are left out: where what it misses between
/// its points is not small against the noise a comparison says nothing.
fn smooth_enough(recording: &Recording, simulation: &Simulation) -> (Recording, usize) {
    let grid = &simulation.clock_s;
    let noise: [f64; 3] = std::array::from_fn(|k| {
        let mut steps: Vec<f64> = recording.a_ng[k].windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        steps.sort_by(f64::total_cmp);
        // Of counts so coarse that most windows have the same, the least that they can differ by.
        let middle = &steps[steps.len() / 2..];
        middle.iter().copied().find(|step| *step > 0.0).unwrap_or(f64::INFINITY)
    });
    let rough: Vec<bool> = (0..grid.len())
        .map(|i| (0..3).any(|k| missed(grid, &simulation.a_ng[k], i) > ROUGHNESS_MAX * noise[k]))
        .collect();
    let touched = |t: f64| {
        let first = grid.partition_point(|g| *g < t - HALF_WINDOW_S).saturating_sub(1);
        let last = (grid.partition_point(|g| *g < t + HALF_WINDOW_S) + 1).min(grid.len());
        rough[first..last].iter().any(|r| *r)
    };
    let touched: Vec<bool> = recording.clock_s.iter().map(|t| touched(*t)).collect();
    let keep: Vec<usize> = (0..touched.len()).filter(|i| !touched[*i]).collect();
    (take(recording, &keep), touched.chunk_by(|a, b| a == b).filter(|stretch| stretch[0]).count())
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_misses_nothing_however_far_apart_the_rows_are() {
        let grid = [0.0, 20.0, 40.0, 180.0, 200.0];
        let line = grid.map(|t| 3.0 - 0.9 * t);
        assert!((0..5).all(|i| missed(&grid, &line, i) < 1e-12));
        // Half the square of t misses an eighth of the square of a step in its middle.
        let parabola = grid.map(|t| 0.5 * t * t);
        for (i, step_s) in [(1, 20.0_f64), (2, 140.0), (3, 140.0)] {
            assert!((missed(&grid, &parabola, i) - step_s.powi(2) / 8.0).abs() < 1e-9);
        }
    }

    #[test]
    fn of_what_is_smooth_hardly_anything_is_missed_and_of_a_jump_an_eighth() {
        let grid: Vec<f64> = (0..200).map(|i| 20.0 * f64::from(i)).collect();
        let most = |series: &dyn Fn(f64) -> f64| {
            let series: Vec<f64> = grid.iter().map(|t| series(*t)).collect();
            (2..198).map(|i| missed(&grid, &series, i)).fold(0.0, f64::max)
        };
        assert!(most(&|t| (std::f64::consts::TAU * t / 500.0).sin()) < 2e-4);
        assert!((most(&|t| f64::from(u8::from(t > 1000.0))) - 0.125).abs() < 1e-12);
        assert!((most(&|t| (t / 20.0 - 50.0).max(0.0)) - 1.0 / 12.0).abs() < 1e-12);
        assert!((most(&|t| f64::from(u8::from(t == 1000.0))) - 0.25).abs() < 1e-12);
    }
}
