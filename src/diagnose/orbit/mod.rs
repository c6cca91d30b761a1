//! Precise orbits against a list of forces: what is missing from the list, per satellite and for all.

mod air;
pub mod arc;
pub mod blunders;
mod compare;
pub mod finer;
pub mod forces;
mod formula;
pub mod held_out;
mod ladder;
pub mod manoeuvre;
mod notes;
pub mod own;
pub mod report;
pub mod search;
pub mod sp3;
pub mod unlisted;

use std::collections::BTreeMap;

use thiserror::Error;

use self::arc::Arc;
use self::forces::{Air, Baseline, Environment, Finer, Term};
use self::search::{Problem, Search};
use crate::diagnose::keys::{lookup, texts};
use crate::diagnose::measured::{Answer, MeasuredCase, MeasuredError, Plates};
use crate::physics::earth_orientation::{EarthOrientation, EarthOrientationError};
use crate::physics::gravity_field::{GravityField, GravityFieldError};

const POSITION_SIGMA_M: f64 = 0.025;
/// What the simulation may include, as the case format names it.
pub const INCLUDES: &str = "gravity:<degree>, sun, moon, relativity, solar_radiation_pressure, srp_y_bias, srp_b_bias, srp_once_per_rev, aerodynamic_drag";

/// An orbit case that cannot be analysed.
#[derive(Debug, Error)]
pub enum OrbitError {
    /// A line of an SP3 file.
    #[error("{file}, line {line}: expected {expected}, found {found:?}")]
    Sp3 {
        /// File name.
        file: String,
        /// Line number, from 1.
        line: usize,
        /// What belongs there.
        expected: &'static str,
        /// What was there.
        found: String,
    },
    /// Nothing to work on.
    #[error("the recording does not hold {what}")]
    Empty {
        /// What was looked for.
        what: String,
    },
    /// A satellite with too few positions.
    #[error("{id} has {found} usable positions to fit, expected at least {expected}")]
    TooFew {
        /// Satellite.
        id: String,
        /// Positions found.
        found: usize,
        /// Positions needed.
        expected: usize,
    },
    /// A word among `includes` that means nothing for an orbit.
    #[error("simulation.includes: expected some of {INCLUDES}, found {found:?}")]
    Includes {
        /// The word.
        found: String,
    },
    /// Earth orientation.
    #[error("{file}: {source}")]
    EarthOrientation {
        /// File name.
        file: String,
        /// What is wrong in it.
        source: EarthOrientationError,
    },
    /// Gravity field.
    #[error("{file}: {source}")]
    Gravity {
        /// File name.
        file: String,
        /// What is wrong in it.
        source: GravityFieldError,
    },
    /// The simulation claims more degrees than its field has.
    #[error("simulation.includes: gravity:{claimed} is more than the field {file} holds, degree {held}")]
    Degree {
        /// File name.
        file: String,
        /// What `includes` says.
        claimed: usize,
        /// The field's degree.
        held: usize,
    },
}

/// Analyse an orbit case.
pub fn diagnose(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<(Answer, Plates), MeasuredError> {
    let mut problem = problem(case, files)?;
    blunders::leave_out(&mut problem);
    let search = searched(&mut problem);
    Ok((report::answer(&case.id, &problem, &search), ladder::plates(&problem, &search)))
}

/// The whole search, with what acts beside the catalogue.
pub fn searched(problem: &mut Problem) -> Search {
    let search = finer::settled(problem);
    let search = beside_the_catalogue(problem, search);
    let last = search.last();
    let drag = last.accepted.iter().any(|(term, _)| *term == Term::Drag);
    let Environment { finer, air, .. } = problem.environment;
    if finer == Finer::ALL || !(drag || search.unlisted.is_some()) {
        return search;
    }
    // What was found here was not there when the finer terms were weighed.
    (problem.environment.finer, problem.environment.air) = (Finer::ALL, Air::MEAN);
    let other = problem.search(&mut |_| ());
    let other = beside_the_catalogue(problem, other);
    if compare::evidence_over(problem, &other.end().fits, &search.end().fits) > 0.0 {
        return other;
    }
    (problem.environment.finer, problem.environment.air) = (finer, air);
    search
}

fn beside_the_catalogue(problem: &mut Problem, search: Search) -> Search {
    let search = air::settled(problem, search);
    unlisted::settled(problem, search)
}

/// The case's arcs and forces.
pub fn problem(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<Problem, MeasuredError> {
    let names = texts(&case.table, "recording.files")
        .or_else(|| Some(vec![case.text("recording.file").ok()?]))
        .ok_or_else(|| case.wrong("recording.files", "a list of SP3 files"))?;
    let sp3: Vec<(String, String)> = names.iter().map(|name| (name.clone(), files[name].clone())).collect();
    let recording = sp3::Recording::read(&sp3)?;
    let (eop_name, field_name) = (case.text("recording.eop")?, case.text("recording.gravity")?);
    let of_eop = |source| OrbitError::EarthOrientation { file: eop_name.clone(), source };
    let eop = EarthOrientation::from_csv(&files[&eop_name]).map_err(of_eop)?;
    let middle_mjd = recording.origin.mjd + (recording.origin.s + 0.5 * recording.span_s()) / 86_400.0;
    let field = GravityField::from_gfc(&files[&field_name], middle_mjd)
        .map_err(|source| OrbitError::Gravity { file: field_name.clone(), source })?;
    let baseline = baseline(case)?;
    if baseline.degree > field.degree() {
        return Err(OrbitError::Degree { file: field_name, claimed: baseline.degree, held: field.degree() }.into());
    }
    let environment = Environment::new(recording.origin, recording.span_s(), &eop, field).map_err(of_eop)?;
    let fit_s = case.number("recording.fit_hours")?.map_or(f64::INFINITY, |h| h * 3600.0);
    if fit_s <= 0.0 {
        return Err(case.wrong("recording.fit_hours", "a number above zero"));
    }
    let sigma_m = case.number("recording.position_sigma_m")?.unwrap_or(POSITION_SIGMA_M);
    if sigma_m <= 0.0 {
        return Err(case.wrong("recording.position_sigma_m", "a number above zero"));
    }
    let wanted = wanted(case)?;
    let (mut arcs, mut left_out, mut short) = (Vec::new(), recording.amiss.clone(), None);
    for track in &recording.tracks {
        if wanted.as_ref().is_none_or(|ids| ids.contains(&track.id)) {
            match Arc::new(track, &environment, fit_s) {
                Ok(arc) => arcs.push(arc),
                // Asked for by name, or the only one: say what is wrong. Among many, one too short is left out.
                Err(error) if wanted.is_some() || recording.tracks.len() == 1 => return Err(error.into()),
                Err(error) => {
                    left_out.push(error.to_string());
                    short.get_or_insert(error);
                }
            }
        }
    }
    let held = |id: &&String| recording.tracks.iter().any(|track| track.id == **id);
    let absent: Vec<&String> = wanted.iter().flatten().filter(|id| !held(id)).collect();
    left_out.extend(absent.iter().map(|id| format!("{id}, which the recording does not hold")));
    if let (true, Some(error)) = (arcs.is_empty(), short) {
        return Err(error.into());
    }
    if arcs.is_empty() {
        let what = wanted.map_or("a satellite".to_owned(), |ids| format!("any of the satellites {}", ids.join(", ")));
        return Err(OrbitError::Empty { what }.into());
    }
    Ok(Problem { environment, baseline, arcs, sigma_m, stated_sigma_m: sigma_m, scatter_m: None, left_out })
}

fn wanted(case: &MeasuredCase) -> Result<Option<Vec<String>>, MeasuredError> {
    match lookup(&case.table, "recording.satellites") {
        None => Ok(None),
        Some(value) if value.as_str() == Some("all") => Ok(None),
        Some(value) if value.as_str().is_some() => Ok(value.as_str().map(|id| vec![id.to_owned()])),
        Some(_) => texts(&case.table, "recording.satellites")
            .map(Some)
            .ok_or_else(|| case.wrong("recording.satellites", "\"all\" or a list such as [\"G05\"]")),
    }
}

/// The force model that the simulation claims.
pub fn baseline(case: &MeasuredCase) -> Result<Baseline, MeasuredError> {
    let mut baseline = Baseline { degree: 0, known: Vec::new(), estimated: Vec::new() };
    for token in &case.includes {
        match (token.as_str(), token.strip_prefix("gravity:").map(str::parse)) {
            (_, Some(Ok(degree))) => baseline.degree = degree,
            ("sun", _) => baseline.known.push(Term::Sun),
            ("moon", _) => baseline.known.push(Term::Moon),
            // Always in: too small to be told from what is unlisted.
            ("relativity", _) => {}
            ("solar_radiation_pressure", _) => baseline.estimated.push(Term::SolarRadiation),
            ("srp_y_bias", _) => baseline.estimated.push(Term::YBias),
            ("srp_b_bias", _) => baseline.estimated.push(Term::BBias),
            ("srp_once_per_rev", _) => baseline.estimated.push(Term::OncePerRev),
            ("aerodynamic_drag", _) => baseline.estimated.push(Term::Drag),
            _ => return Err(OrbitError::Includes { found: token.clone() }.into()),
        }
    }
    Ok(baseline)
}
