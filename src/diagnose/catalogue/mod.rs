//! The catalogue: one file an effect, one flat list.
//!
//! An effect says what series the recording has and the simulation lacks, as linear columns (with the size each
//! coefficient may have) at given values of its nonlinear parameters. It searches nothing.

use super::design::{OnAxis, Raw};
use super::noise::Stretch;
use super::scene::{Axes, Scene};

pub mod aerodynamic_drag;
pub mod atmosphere_corotation;
pub mod bias_drift;
pub mod bias_step;
pub mod cg_offset;
pub mod crew_activity;
pub mod diurnal_bulge;
pub mod evaporator_venting;
pub mod gravity_gradient;
#[cfg(test)]
pub(super) mod made;
pub mod magnetic_sensitivity;
pub mod mass_shift;
pub mod misalignment;
pub mod rotation;
pub mod scale_factor;
pub mod solar_radiation_pressure;
pub mod temperature_bias;
pub mod thermospheric_wind;
pub mod thruster_residual;
pub mod time_offset;
pub mod vent_leak;
pub mod water_dump;

/// Every effect a record of accelerations can be searched for.
pub const ALL: &[&Effect] = &[
    &gravity_gradient::EFFECT,
    &rotation::EFFECT,
    &cg_offset::EFFECT,
    &mass_shift::EFFECT,
    &aerodynamic_drag::EFFECT,
    &diurnal_bulge::EFFECT,
    &atmosphere_corotation::EFFECT,
    &thermospheric_wind::EFFECT,
    &solar_radiation_pressure::EFFECT,
    &vent_leak::EFFECT,
    &water_dump::EFFECT,
    &evaporator_venting::EFFECT,
    &thruster_residual::EFFECT,
    &crew_activity::EFFECT,
    &magnetic_sensitivity::EFFECT,
    &scale_factor::EFFECT,
    &misalignment::EFFECT,
    &temperature_bias::EFFECT,
    &bias_drift::EFFECT,
    &bias_step::EFFECT,
    &time_offset::EFFECT,
];

/// An effect of [`ALL`] under circumstances that are rarer, looked for where something is found that may be one of them.
pub struct Seldom {
    /// It.
    pub effect: &'static Effect,
    /// What it would be without these circumstances, in the catalogue that is searched or left out of it: never less likely.
    pub usual: &'static Effect,
    /// Log odds of the circumstances.
    pub log_odds: f64,
}

/// All of them.
///
/// A log forgets more seldom than two rivals may be apart, so that no shift it lacks is a rival of what it imitates.
pub const SELDOM: &[Seldom] = &[
    Seldom { effect: &mass_shift::UNLOGGED, usual: &cg_offset::EFFECT, log_odds: -6.0 },
    Seldom { effect: &mass_shift::LATE, usual: &mass_shift::EFFECT, log_odds: -3.0 },
];

/// The effect of an id.
pub fn by_id(id: &str) -> Option<&'static Effect> {
    ALL.iter().find(|e| e.id == id).copied()
}

/// Nonlinear parameters of an effect, in its own coordinates.
pub type Theta = [f64; 2];

/// One entry.
pub struct Effect {
    /// Fixed id.
    pub id: &'static str,
    /// Name for people.
    pub name: &'static str,
    /// The equation, in the letters of the field.
    pub equation: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// What it follows: a covariate, no cause.
    pub covariate: &'static str,
    /// What it is mistaken for.
    pub mistaken_for: &'static [&'static str],
    /// Linear coefficients, in the order of the columns.
    pub linear: &'static [Linear],
    /// What the usual sizes may be multiplied by.
    pub scales: &'static [Scale],
    /// Nonlinear parameters, in the order of [`Theta`].
    pub nonlinear: &'static [Nonlinear],
    /// Starting points over the whole prior range.
    pub grid: fn(&Scene) -> Vec<Theta>,
    /// Log prior density of the parameters that are refined, in their coordinates, where they are not at their atom.
    pub log_density: fn(&Scene, &Theta) -> f64,
    /// Its series at `Theta`, `None` where the case does not allow it (no such event, for one).
    pub signature: fn(&Scene, &Theta) -> Option<Shape>,
    /// Where its series is only nearly linear in its coefficients: the `Theta` whose columns are exact at these coefficients.
    pub exact_at: Option<fn(&[f64]) -> Theta>,
    /// What its series at `Theta` takes for granted and no record says, to be told with it.
    pub assumes: Option<fn(&Scene, &Theta) -> Option<String>>,
    /// Why it is this one, for a flight engineer.
    pub why: &'static str,
}

/// What usual sizes may be multiplied by, and how likely that is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// The factor.
    pub factor: f64,
    /// Its share of the prior.
    pub share: f64,
}

const fn scale(factor: f64, share: f64) -> Scale {
    Scale { factor, share }
}

/// Scales of a term that has one size.
pub const ONE_SIZE: &[Scale] = &[scale(1.0, 1.0)];
/// Scales of a term that is left out or not: about all of it, or seldom a part.
pub const WHOLE_OR_PART: &[Scale] = &[scale(1.0, 0.9), scale(10.0, 0.1)];
/// Scales of an effect that is of its usual size or well below it.
pub const USUAL_OR_SMALL: &[Scale] = &[scale(1.0, 0.5), scale(0.2, 0.5)];
/// Scales of a push or a form that is seldom far above its usual size, and is then still itself: a prior that rules such sizes out gives
/// them to whatever else comes near.
pub const SELDOM_LARGE: &[Scale] = &[scale(1.0, 0.4875), scale(0.2, 0.4875), scale(8.0, 0.025)];
/// Scales of an effect whose size nobody knows beforehand: its prior must not take from a large one what another form then gives back.
pub const ANY_SIZE: &[Scale] = &[scale(1.0, 1.0 / 3.0), scale(0.2, 1.0 / 3.0), scale(5.0, 1.0 / 3.0)];

/// A linear coefficient.
pub struct Linear {
    /// Name in `diagnosis.json`.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Its usual size.
    pub size: f64,
    /// A value beyond this is not credible, whatever the fit.
    pub size_max: f64,
    /// Below this it is no such effect any more.
    pub least: f64,
    /// The simulation lacks the whole term, or seldom a part of it: the prior is about one.
    pub whole: bool,
}

/// What is believed of a linear coefficient beforehand, if its effect is there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub size: f64,
}

/// What a term's own model (density, attitude, offset) may usually be off by where the whole of it is missing.
const WHOLE_SIZE: f64 = 0.1;

/// Most of a term that can be missing: as far above one as its own model is off in storms, six usual sizes.
const MISSING_MAX: f64 = 1.6;

impl Linear {
    /// Of either sign, and no whole term.
    const PLAIN: Self =
        Self { name: "", unit: "", size: 1.0, size_max: f64::INFINITY, least: f64::NEG_INFINITY, whole: false };
    /// A whole term.
    const WHOLE: Self = Self { least: 0.0, whole: true, ..Self::PLAIN };

    /// Its prior.
    pub fn prior(&self) -> Prior {
        if self.whole { Prior { mean: 1.0, size: WHOLE_SIZE } } else { Prior { mean: 0.0, size: self.size } }
    }

    /// Why a size cannot be believed, if it cannot; `doubt` is what it may be out by.
    pub fn refuses(&self, value: f64, doubt: f64) -> Option<String> {
        let needs = |bound: f64, which| {
            let unit = Some(self.unit).filter(|unit| *unit != "1").map(|unit| format!(" {unit}")).unwrap_or_default();
            Some(format!(
                "it would need {} = {value:.3}{unit}, and {bound} is the {which} that can be believed",
                self.name
            ))
        };
        if value.abs() > self.size_max {
            return needs(self.size_max.copysign(value), if value > 0.0 { "most" } else { "least" });
        }
        if value + doubt < self.least {
            return needs(self.least, "least");
        }
        (self.whole && value - doubt > MISSING_MAX)
            .then(|| format!("it would need {value:.2} of the term, and a simulation lacks all of it at most"))
    }
}

/// A nonlinear parameter.
pub struct Nonlinear {
    /// Name in `diagnosis.json`; a word (`axis`) is discrete.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// The coordinate is its logarithm.
    pub log: bool,
    /// First step of its refinement, in its coordinate; 0 for a discrete one.
    pub step: f64,
    /// The evidence along it is no parabola near its peak but changes with the noise of every window.
    pub jagged: bool,
    /// A value that has half of the prior to itself. Of an effect with this parameter alone.
    pub atom: Option<f64>,
    /// Lowest and highest coordinate, where the scene does not say otherwise.
    pub range: [f64; 2],
}

impl Nonlinear {
    /// Neither refined nor jagged, without bounds and without a value of its own.
    pub(in crate::diagnose) const PLAIN: Self = Self {
        name: "",
        unit: "",
        log: false,
        step: 0.0,
        jagged: false,
        atom: None,
        range: [f64::NEG_INFINITY, f64::INFINITY],
    };
}

/// The form of a signature.
#[derive(Debug, Clone)]
pub enum Shape {
    /// One series, with a coefficient for every body axis.
    Scalar {
        /// Number of its windows.
        windows: usize,
        /// First of them in which it is not zero.
        first: usize,
        /// Its values from there to the last that is not zero.
        values: Vec<f64>,
    },
    /// Several series at the windows, each with a coefficient for every body axis.
    Several(Vec<Vec<f64>>),
    /// One series triple a coefficient.
    Columns(Vec<Raw>),
    /// A series whose amplitude is given by `Theta` alone.
    Fixed(Axes),
}

impl Shape {
    /// One series, with a coefficient for every body axis.
    pub fn scalar(mut series: Vec<f64>) -> Self {
        let windows = series.len();
        let Stretch { first, values } = Stretch::of(&series);
        let end = first + values.len();
        series.truncate(end);
        series.drain(..first);
        series.shrink_to_fit();
        Shape::Scalar { windows, first, values: series }
    }

    /// How many columns it has.
    pub fn count(&self) -> usize {
        match self {
            Shape::Scalar { .. } => 3,
            Shape::Several(series) => 3 * series.len(),
            Shape::Columns(columns) => columns.len(),
            Shape::Fixed(_) => 1,
        }
    }

    /// As columns; a fixed shape is one column.
    pub fn columns(&self) -> Vec<Raw> {
        match self {
            Shape::Scalar { windows, first, values } => {
                let mut series = vec![0.0; *windows];
                series[*first..first + values.len()].copy_from_slice(values);
                on_each_axis(&series).collect()
            }
            Shape::Several(series) => series.iter().flat_map(|series| on_each_axis(series)).collect(),
            Shape::Columns(columns) => columns.clone(),
            Shape::Fixed(axes) => vec![full(axes.clone())],
        }
    }

    /// The series of every column on the axes it acts on, of sizes times `scale`; a fixed shape is one column of size 1.
    pub fn on_axes(&self, sizes: &[f64], scale: f64) -> Vec<Vec<OnAxis<'_>>> {
        match self {
            Shape::Scalar { first, values, .. } => {
                let series = Stretch { first: *first, values };
                (0..3).map(|axis| vec![OnAxis { axis, series, size: scale * sizes[axis] }]).collect()
            }
            Shape::Several(several) => {
                let columns = several.iter().zip(sizes.chunks(3)).flat_map(|(values, sizes)| {
                    let series = Stretch::of(values);
                    (0..3).map(move |axis| vec![OnAxis { axis, series, size: scale * sizes[axis] }])
                });
                columns.collect()
            }
            Shape::Columns(columns) => columns
                .iter()
                .zip(sizes)
                .map(|(raw, size)| {
                    let size = scale * size;
                    let on_axes = raw.iter().enumerate();
                    on_axes
                        .filter_map(|(axis, s)| Some(OnAxis { axis, series: Stretch::of(s.as_ref()?), size }))
                        .collect()
                })
                .collect(),
            Shape::Fixed(axes) => {
                let on_axes = axes.iter().enumerate();
                vec![on_axes.map(|(axis, s)| OnAxis { axis, series: Stretch::of(s), size: 1.0 }).collect()]
            }
        }
    }
}

/// A series on one body axis, and on the next, and on the last.
fn on_each_axis(series: &[f64]) -> impl Iterator<Item = Raw> {
    (0..3).map(|k| std::array::from_fn(|j| (j == k).then(|| series.to_vec())))
}

/// A column on all three axes.
pub fn full(axes: Axes) -> Raw {
    axes.map(Some)
}

/// The single point of effects without nonlinear parameters.
pub fn one_point(_: &Scene) -> Vec<Theta> {
    vec![[0.0; 2]]
}

/// The density where nothing is refined.
pub fn no_density(_: &Scene, _: &Theta) -> f64 {
    0.0
}

/// Natural log of the prior odds of every effect against its being absent: about one in fifty records has it.
pub const LOG_PRIOR: f64 = -4.0;

/// Three coefficients of a push fixed in the body.
pub const fn push(size_ng: f64, size_max_ng: f64) -> [Linear; 3] {
    [
        Linear { name: "ax_ng", unit: "ng", size: size_ng, size_max: size_max_ng, ..Linear::PLAIN },
        Linear { name: "ay_ng", unit: "ng", size: size_ng, size_max: size_max_ng, ..Linear::PLAIN },
        Linear { name: "az_ng", unit: "ng", size: size_ng, size_max: size_max_ng, ..Linear::PLAIN },
    ]
}

/// An unlogged instant at which something begins.
pub const ONSET: Nonlinear = Nonlinear { name: "onset_s", unit: "s", step: 300.0, jagged: true, ..Nonlinear::PLAIN };

/// The density of an onset that is as likely anywhere in the record.
pub fn anywhere(scene: &Scene, _: &Theta) -> f64 {
    let [start, end] = scene.span_s();
    -(end - start).ln()
}

/// Onsets nearer to the ends of the record than this leave nothing to tell what was before from what is after, s.
const FROM_THE_ENDS_S: f64 = 300.0;

/// Whether an onset is inside the record.
pub fn is_inside(scene: &Scene, onset_s: f64) -> bool {
    let [start, end] = scene.span_s();
    onset_s > start + FROM_THE_ENDS_S && onset_s < end - FROM_THE_ENDS_S
}

/// Onsets at a spacing inside the record, away from its ends by `margin_s`.
pub fn onsets(scene: &Scene, spacing_s: f64, margin_s: f64) -> Vec<f64> {
    let [start, end] = scene.span_s();
    let n = ((end - start - 2.0 * margin_s) / spacing_s).floor().max(0.0) as usize;
    (0..=n).map(|i| start + margin_s + i as f64 * spacing_s).collect()
}

/// A series born in the sensor, `at` instants: the two-position measurements of a dump see it too, and what the law of the bias then takes
/// from the windows is no longer in them. Behind its values at the windows are those at the measurements, law by law.
pub fn in_sensor(scene: &Scene, at: impl Fn(&[f64]) -> Vec<f64>) -> Shape {
    let windows = at(scene.clock_s());
    let laws = &scene.case.recording.bias_laws;
    if laws.iter().all(Vec::is_empty) {
        return Shape::scalar(windows);
    }
    let column = |k: usize| {
        let mut left = windows.clone();
        let measured: Vec<Vec<f64>> = laws[k].iter().map(|law| at(&law.measured_s)).collect();
        laws[k].iter().zip(&measured).for_each(|(law, measured)| law.take_from(&mut left, measured));
        left.extend(measured.concat());
        std::array::from_fn(|axis| (axis == k).then(|| left.clone()))
    };
    Shape::Columns((0..3).map(column).collect())
}

/// Kinds of entries in the log that effects of the catalogue go by.
pub const LOGGED_KINDS: [&str; 4] = [water_dump::KIND, evaporator_venting::KIND, "thruster", "crew_sleep"];

/// Effects that push while an entry of the log lasts, and the kind of it.
pub const LOGGED_PUSHES: [(&str, &str); 3] = [
    ("water_dump", water_dump::KIND),
    ("evaporator_venting", evaporator_venting::KIND),
    ("thruster_residual", "thruster"),
];

/// The kind of entries in the log that an effect acts by, and by nothing else.
pub fn logged_kind(id: &str) -> Option<&'static str> {
    match id {
        "water_dump" => Some(water_dump::KIND),
        "evaporator_venting" => Some(evaporator_venting::KIND),
        _ => None,
    }
}

/// The series of a push that lasts while an entry of the kind does, if the log has it inside the record: entries that overlap
/// are one push.
pub fn lasting(scene: &Scene, kind: &str) -> Option<Vec<f64>> {
    share_of(scene, &super::measure::union(scene.case.spans(kind)))
}

/// The series of a push that every entry of the kind adds, such as a firing, if the log has it inside the record.
pub fn added(scene: &Scene, kind: &str) -> Option<Vec<f64>> {
    share_of(scene, &scene.case.spans(kind))
}

fn share_of(scene: &Scene, spans: &[[f64; 2]]) -> Option<Vec<f64>> {
    let share = super::measure::coverage(scene.clock_s(), spans);
    let windows = share.iter().filter(|s| **s > 0.0).count();
    (windows >= 2 && windows + 2 <= share.len()).then_some(share)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A simulation cannot have more of a term than all of it, nor lack more: beyond what the value may be out by.
    #[test]
    fn sizes_that_cannot_be_are_refused_with_the_bound() {
        let drag = &aerodynamic_drag::EFFECT.linear[0];
        let refused = drag.refuses(-1.2, 0.1).unwrap();
        assert_eq!(refused, "it would need fraction = -1.200, and -1 is the least that can be believed");
        assert_eq!(drag.refuses(-1.05, 0.1), None);
        assert!(drag.refuses(3.1, 0.1).is_some_and(|why| why.contains("3 is the most")));
        let gradient = &gravity_gradient::EFFECT.linear[0];
        assert!(gradient.refuses(-0.2, 0.1).is_some_and(|why| why.contains("0 is the least")));
        assert_eq!([0.05, 1.0, 1.65].map(|fraction| gradient.refuses(fraction, 0.1)), [None, None, None]);
        assert!(gradient.refuses(1.8, 0.1).is_some());
        let offset = &cg_offset::EFFECT.linear[2];
        assert!(offset.refuses(-7.0, 0.5).is_some_and(|why| why.contains("dz_m = -7.000 m")));
    }

    #[test]
    fn every_entry_is_whole_and_named_once() {
        for (i, e) in ALL.iter().enumerate() {
            assert!(ALL[..i].iter().all(|other| other.id != e.id), "{} twice", e.id);
            assert!(
                !e.equation.is_empty() && !e.source.is_empty() && !e.why.is_empty() && !e.mistaken_for.is_empty(),
                "{}",
                e.id
            );
            assert!(!e.linear.is_empty() || !e.nonlinear.is_empty(), "{} has nothing to fit", e.id);
            assert!(e.linear.iter().all(|l| l.size > 0.0 && l.size_max > 2.0 * l.size), "{}: sizes", e.id);
            assert!(e.nonlinear.len() <= 2, "{}", e.id);
            for p in e.nonlinear {
                assert!(!p.name.is_empty(), "{}: a parameter without a name", e.id);
                let fits =
                    |atom: f64| e.nonlinear.len() == 1 && p.step > 0.0 && p.range[0] <= atom && atom <= p.range[1];
                assert!(p.atom.is_none_or(fits), "{}: {}", e.id, p.name);
            }
            assert_eq!(by_id(e.id).map(|x| x.name), Some(e.name));
        }
    }
}
