//! What is said of a mismatch that no effect explains: a description, not a cause.

use super::judge::Failure;
use super::{Best, ids};
use crate::diagnose::answer::Hypothesis;
use crate::diagnose::model::Fitted;
use crate::diagnose::remains::Remains;
use crate::diagnose::search::{Family, Weighed};
use crate::diagnose::solve::Library;

/// How a formula is evaluated.
const READ: &str = "To evaluate it: SI units, T in C, m and a_d (simulation and modelled drag) in ng, angles as their sines; each part over its \
                    deviation in this record, coefficients of x, y, z part by part; a constant per axis is free.";

/// From what remains after the best explanation; `beside` names that.
pub fn of_remains(r: &Remains, beside: &str) -> Hypothesis {
    Hypothesis {
        formula: r.form.clone(),
        axis: r.axis.clone(),
        unit: "ng".into(),
        location: format!("{}.{beside}", r.location),
    }
}

/// Of a set whose evidence is beyond doubt, and which failed its trial: something is there, and it is not this.
pub fn of_failure(Failure { set, why }: &Failure) -> String {
    format!("It is where {set} would act, which comes nearest; but a finding is refused: {why}.")
}

/// By how much the listed sets that came near are less likely than the best of all.
fn near_fail(library: &Library, best: &Best, listed: &[&Weighed]) -> String {
    let near = |w: &&Weighed| {
        format!(
            "{} lacks {:.1} in log evidence",
            ids(library, &w.set).join(" + "),
            best.weighed.log_posterior - w.log_posterior
        )
    };
    listed.iter().take(3).map(near).collect::<Vec<_>>().join("; ")
}

/// From the open forms that won, or from the listed set that leads and cannot be believed, with the listed sets that came near. What of the
/// catalogue is in it stands as its equation with its parameters, and without its name: the formula gives what was fitted.
pub fn hypothesis(library: &Library, best: &Best, listed: &[&Weighed]) -> Hypothesis {
    let fails = near_fail(library, best, listed);
    let mut formula = Vec::new();
    let mut axis = Vec::new();
    let mut location = Vec::new();
    for (i, m) in best.set.members.iter().enumerate() {
        let axes = m.axis.map_or("x, y, z", |a| ["x", "y", "z"][a]);
        let form = match library.entries[m.entry].family {
            Family::Open(form) => form,
            Family::Listed(effect) => {
                let of = |p: &Fitted| format!("{} = {}", p.name, with_error(p.value, p.sigma));
                let parameters: Vec<String> = best.fits[i].parameters.iter().map(of).collect();
                formula.push(format!("({}) with {}", effect.equation, parameters.join(", ")));
                axis.push(axes);
                location.push(effect.covariate.replace('_', " "));
                continue;
            }
        };
        let amplitudes: Vec<String> = best.fits[i].parameters.iter().map(|p| with_error(p.value, p.sigma)).collect();
        let (said, member) = (&library.forms[form], m.theta[0] as usize);
        let deviations: Vec<String> = said.deviations[member].iter().map(|d| format!("{d:.4e}")).collect();
        formula.push(format!(
            "[{}] ng x ({}) / [{}]",
            amplitudes.join(", "),
            said.formulas[member],
            deviations.join(", ")
        ));
        axis.push(axes);
        location.push(library.forms[form].location.to_string());
    }
    let failing = if fails.is_empty() { String::new() } else { format!(" Near catalogue effects fail: {fails}.") };
    Hypothesis {
        formula: formula.join(" + "),
        axis: axis.join("; "),
        unit: "ng".into(),
        location: format!("Where it lives: {}. {READ}{failing}", location.join(", and ")),
    }
}

/// A value and its standard error in brackets, to a tenth or, where the error is smaller, to its second figure.
fn with_error(value: f64, sigma: f64) -> String {
    let figures = if sigma > 0.0 { (1.0 - sigma.log10().floor()).clamp(1.0, 12.0) as usize } else { 1 };
    format!("{value:.figures$}({sigma:.figures$})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_coefficient_keeps_its_figures() {
        assert_eq!(with_error(-12.34, 2.06), "-12.3(2.1)");
        assert_eq!(with_error(0.0123, 0.00456), "0.0123(0.0046)");
        assert_eq!(with_error(5.0, 0.0), "5.0(0.0)");
    }
}
