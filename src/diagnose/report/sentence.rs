//! The sentence a flight engineer needs, from the answer.

use crate::diagnose::answer::{Diagnosis, Fit, Verdict};
use crate::paper::page::words;

/// One or two sentences: what is missing, how large it is, what to do.
pub fn sentence(d: &Diagnosis) -> String {
    match d.verdict {
        Verdict::Consistent => consistent(d),
        Verdict::Explained => explained(d),
        Verdict::Ambiguous => ambiguous(d),
        Verdict::Unexplained => unexplained(d),
    }
}

fn consistent(d: &Diagnosis) -> String {
    let loosest = d.upper_limits.iter().max_by(|a, b| a.limit_ng.total_cmp(&b.limit_ng));
    let limit = loosest.map_or(String::new(), |l| {
        format!(" The least well bounded effect, {}, stays below {} ng rms (95 %).", words(&l.id), short(l.limit_ng))
    });
    let nothing = match d.alternatives.first() {
        Some(a) => {
            let set = a.effects.iter().map(|id| words(id)).collect::<Vec<_>>().join(" with ");
            let posterior = short(a.posterior);
            format!("nothing is claimed. What comes nearest, and lacks the proof, is {set} (posterior {posterior}).")
        }
        None => "there is nothing to correct.".into(),
    };
    format!("The recording agrees with the simulation within its noise: {nothing}{limit}")
}

fn explained(d: &Diagnosis) -> String {
    let names: Vec<String> = d
        .effects
        .iter()
        .map(|e| {
            let size = e.rms_ng.map_or(String::new(), |r| format!(" ({} ng rms)", short(norm(r))));
            format!("{}{size}", lower_first(&e.name))
        })
        .collect();
    let unseen = d.fit.as_ref().map_or(String::new(), of_unseen);
    let why = match d.effects.as_slice() {
        [only] => format!(" {}", only.why.trim()),
        all => all.iter().map(|e| format!(" {}: {}", e.name, lower_first(e.why.trim()))).collect(),
    };
    format!("What the simulation lacks or has wrong: {}.{why}{unseen}", listed(&names, "and"))
}

/// How the misfit changes on data that the fit has not seen; where the blocks held out have no part in the effect there is nothing to tell.
fn of_unseen(fit: &Fit) -> String {
    let [before, after, floor] = [fit.held_out.before_rms_ng, fit.held_out.after_rms_ng, fit.noise_floor_ng].map(norm);
    let figures = || format!("from {} to {} ng, against noise of {} ng", short(before), short(after), short(floor));
    match after / before {
        share if share < 0.995 => {
            format!(" With it, the misfit on data the fit has not seen falls {}.", figures())
        }
        share if share > 1.01 => format!(
            " The misfit on data the fit has not seen rises {}: a part of the record does not tell what the rest has, and the figures hold \
             for all of it alone.",
            figures()
        ),
        _ => String::new(),
    }
}

fn ambiguous(d: &Diagnosis) -> String {
    let sets: Vec<String> = d
        .cannot_tell_apart
        .iter()
        .map(|set| set.iter().map(|id| words(id)).collect::<Vec<_>>().join(" with "))
        .collect();
    let next = d
        .separating_observation
        .as_ref()
        .map_or(String::new(), |s| format!(" The cheapest observation that would tell more: {}", s.text.trim()));
    format!(
        "The simulation lacks something, and this recording cannot tell whether it is {}.{next}",
        listed(&sets, "or")
    )
}

fn unexplained(d: &Diagnosis) -> String {
    let axes =
        if d.located.axes.is_empty() { String::new() } else { format!(" on {}", listed(&d.located.axes, "and")) };
    let follows = d.located.covariates.first().map_or(String::new(), |c| format!(", following {}", words(&c.name)));
    let formula = d.hypothesis.as_ref().map_or(String::new(), |h| {
        format!(" A formula that describes it (a description, not a cause): {} ({}).", h.formula, h.unit)
    });
    format!(
        "Something acts{axes}{follows} that no effect of the catalogue explains; do not correct for it by name.{formula}"
    )
}

/// A number in three digits or all before the point, and in thousandths at most.
pub fn short(x: f64) -> String {
    match x.abs() {
        a if a >= 100.0 => format!("{x:.0}"),
        a if a >= 10.0 => format!("{x:.1}"),
        a if a >= 1.0 => format!("{x:.2}"),
        _ => format!("{x:.3}"),
    }
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// A name inside a sentence: its first letter small, unless that stands alone and is a symbol.
pub fn lower_first(name: &str) -> String {
    let mut letters = name.chars();
    match (letters.next(), letters.as_str()) {
        (Some(first), rest) if rest.starts_with(|next: char| next.is_lowercase() || next == ' ') => {
            first.to_lowercase().chain(rest.chars()).collect()
        }
        _ => name.to_owned(),
    }
}

fn listed(items: &[String], last: &str) -> String {
    match items {
        [] => "something".into(),
        [only] => only.clone(),
        [head @ .., tail] => format!("{} {last} {tail}", head.join(", ")),
    }
}
