//! What can be drawn for: one satellite, one set of poses, one axis; with what its full model sees clearly.

use std::collections::BTreeMap;

use super::Said;
use crate::diagnose::answer::ParameterAnswer;
use crate::diagnose::measured::answer::parameter;
use crate::diagnose::measured::{Kind, MeasuredCase, MeasuredError};
use crate::diagnose::orbit::forces::{Baseline, Term};
use crate::diagnose::orbit::report;
use crate::diagnose::orbit::search::{Problem, estimates};
use crate::diagnose::poses::still::Pose;
use crate::diagnose::poses::{self, Part};
use crate::diagnose::series::{self, Follows, read::Series, search};
use crate::diagnose::{orbit, poses as poses_room};

/// A term can be drawn when the full model sees it at this many standard errors or more.
const CLEAR: f64 = 12.0;
/// Name of an axis' one linear coefficient: a slope, a step, a fraction.
const COEFFICIENT: &str = "coefficient";
/// Degrees of the field that a removal leaves; the lot takes one of them by the satellite's place in the list.
const DEGREES_LEFT: [usize; 3] = [2, 3, 4];

/// Something that can be taken out.
#[derive(Debug, Clone)]
pub struct Removable {
    /// Catalogue id.
    pub id: &'static str,
    /// The full model's coefficients.
    pub coefficients: Vec<ParameterAnswer>,
}

/// One subject.
pub struct Subject {
    /// Such as `gps-2010 G05`.
    pub id: String,
    /// What can be taken out.
    pub removable: Vec<Removable>,
    of: Of,
}

enum Of {
    Orbit { problem: Box<Problem>, degree_left: usize },
    Poses { poses: Vec<Pose>, gravity: f64 },
    Axis { series: Box<Series>, axis: usize, full: Vec<Follows> },
}

/// The subjects of a case.
pub fn subjects(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<Vec<Subject>, MeasuredError> {
    match case.kind {
        Kind::OrbitSp3 => orbits(case, files),
        Kind::StaticPoses => pose_sets(case, files),
        Kind::SeriesCsv => axes(case, files),
    }
}

fn orbits(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<Vec<Subject>, MeasuredError> {
    use rayon::prelude::*;
    let all = orbit::problem(case, files)?;
    let full = Baseline {
        degree: all.baseline.degree.max(8),
        known: vec![Term::Sun, Term::Moon],
        estimated: vec![Term::SolarRadiation, Term::YBias, Term::BBias, Term::OncePerRev],
    };
    let one = |(i, arc): (usize, &orbit::arc::Arc)| {
        let problem = Problem {
            environment: all.environment.clone(),
            baseline: full.clone(),
            arcs: vec![arc.clone()],
            sigma_m: all.sigma_m,
            stated_sigma_m: all.stated_sigma_m,
            scatter_m: all.scatter_m,
            left_out: Vec::new(),
        };
        let level = problem.fit(&full, Vec::new(), None);
        let degree_left = DEGREES_LEFT[i % DEGREES_LEFT.len()];
        let terms = [Term::Sun, Term::Moon, Term::DegreesFrom(degree_left + 1)];
        let mut removable = Vec::new();
        for term in terms.into_iter().chain(full.estimated.iter().copied()) {
            let found = estimates(&problem, &level, 0, term);
            if !found.iter().any(|e| e.value.abs() >= CLEAR * e.sigma) {
                continue;
            }
            // Of a term of known size the truth is its size, not an estimate of it.
            let of = |(e, name): (&orbit::search::Estimate, &&str)| match term.is_known_size() {
                true => parameter(name, 1.0, e.sigma, "1"),
                false => parameter(name, e.value, e.sigma, term.unit()),
            };
            let coefficients = found.iter().zip(term.parameters()).map(of).collect();
            removable.push(Removable { id: term.id(), coefficients });
        }
        let id = format!("{} {}", case.id, arc.id);
        Subject { id, removable, of: Of::Orbit { problem: Box::new(problem), degree_left } }
    };
    Ok(all.arcs.par_iter().enumerate().map(one).collect())
}

fn pose_sets(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<Vec<Subject>, MeasuredError> {
    let gravity = poses_room::gravity(case)?;
    let all = poses_room::poses(case, files)?;
    let every = |from: usize, step: usize| all.iter().skip(from).step_by(step).copied().collect::<Vec<Pose>>();
    let mut sets = vec![("all poses", all.clone()), ("even poses", every(0, 2)), ("odd poses", every(1, 2))];
    sets.push((
        "all but every third pose",
        all.iter().enumerate().filter(|(i, _)| i % 3 != 0).map(|(_, p)| *p).collect(),
    ));
    let one = |(name, poses): (&str, Vec<Pose>)| {
        let full = poses::fit(&Part::ALL, &poses, gravity);
        let mut removable = Vec::new();
        for part in Part::ALL {
            let values = full.values(part);
            if values.iter().any(|(value, sigma)| value.abs() >= CLEAR * sigma) {
                removable.push(Removable { id: part.id(), coefficients: named(part, &values) });
            }
        }
        Subject { id: format!("{} {name}", case.id), removable, of: Of::Poses { poses, gravity } }
    };
    Ok(sets.into_iter().map(one).collect())
}

fn named(part: Part, values: &[(f64, f64); 3]) -> Vec<ParameterAnswer> {
    let one = |k: usize| parameter(&format!("{} {}", part.id(), ["1", "2", "3"][k]), values[k].0, values[k].1, "");
    (0..3).map(one).collect()
}

fn axes(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<Vec<Subject>, MeasuredError> {
    let series = series::read::series(case, files)?;
    let mut subjects = Vec::new();
    for (axis, own) in series.axes.iter().enumerate() {
        let full = if own.control { Vec::new() } else { search::search(&series, own, &[]).model() };
        let fit = search::regress(&series, own, &full);
        let mut removable = Vec::new();
        for (follows, (value, sigma)) in full.iter().zip(&fit.coefficients) {
            if value.abs() >= 2.0 * sigma {
                let coefficients = vec![parameter(COEFFICIENT, *value, *sigma, "")];
                removable.push(Removable { id: follows.id(), coefficients });
            }
        }
        let of = Of::Axis { series: Box::new(series.clone()), axis, full };
        subjects.push(Subject { id: format!("{} {}", case.id, own.column), removable, of });
    }
    Ok(subjects)
}

impl Subject {
    /// Analyse the subject with one term taken out of its simulation.
    pub fn analyse(&self, removed: &str) -> Said {
        match &self.of {
            Of::Orbit { problem, degree_left } => orbit_said(problem, *degree_left, removed),
            Of::Poses { poses, gravity } => poses_said(poses, *gravity, removed),
            Of::Axis { series, axis, full } => axis_said(series, *axis, full, removed),
        }
    }
}

fn orbit_said(problem: &Problem, degree_left: usize, removed: &str) -> Said {
    let mut baseline = problem.baseline.clone();
    baseline.known.retain(|term| term.id() != removed);
    baseline.estimated.retain(|term| term.id() != removed);
    if removed == "gravity_degree" {
        baseline.degree = degree_left;
    }
    let mut reduced = Problem {
        environment: problem.environment.clone(),
        baseline,
        arcs: problem.arcs.clone(),
        sigma_m: problem.sigma_m,
        stated_sigma_m: problem.stated_sigma_m,
        scatter_m: problem.scatter_m,
        left_out: Vec::new(),
    };
    let search = orbit::searched(&mut reduced);
    let answer = report::answer("", &reduced, &search);
    let arc = &answer.arcs[0];
    Said {
        named: answer.effects.iter().map(|e| e.id.clone()).collect(),
        verdict: arc.verdict.word().to_owned(),
        coefficients: answer.effects.iter().flat_map(|e| e.parameters.clone()).collect(),
        rms: [arc.rms_before, arc.rms_after],
    }
}

fn poses_said(poses: &[Pose], gravity: f64, removed: &str) -> Said {
    let parts: Vec<Part> = Part::ALL.into_iter().filter(|part| part.id() != removed).collect();
    let found = poses::search(&parts, poses, gravity);
    let last = &found.fits[found.fits.len() - 1];
    Said {
        named: found.added.iter().map(|(part, _)| part.id().to_owned()).collect(),
        verdict: if found.added.is_empty() { "consistent" } else { "explained" }.to_owned(),
        coefficients: found.added.iter().flat_map(|(part, _)| named(*part, &last.values(*part))).collect(),
        rms: [found.fits[0].rms(), last.rms()],
    }
}

fn axis_said(series: &Series, axis: usize, full: &[Follows], removed: &str) -> Said {
    let left: Vec<Follows> = full.iter().filter(|f| f.id() != removed).copied().collect();
    let found = search::search(series, &series.axes[axis], &left);
    let last = found.last();
    let of = |i: usize| {
        let (value, sigma) = last.coefficients[left.len() + i];
        parameter(COEFFICIENT, value, sigma, "")
    };
    Said {
        named: found.effects.iter().map(|(f, _)| f.id().to_owned()).collect(),
        verdict: if found.effects.is_empty() { "consistent" } else { "explained" }.to_owned(),
        coefficients: (0..found.effects.len()).map(of).collect(),
        rms: [found.fits[0].rms(), last.rms()],
    }
}
