//! These cases on paper: one self-contained page with its figures inside, like that of a flight recording.
//!
//! Every figure comes from the answer or its plates; nothing is computed here, and nothing written.

use std::fmt::Write;

use super::answer::{ArcAnswer, Effect};
use super::spread::median;
use super::{Answer, Plates, figures};
use crate::diagnose::answer::{ParameterAnswer, Verdict};
use crate::diagnose::report::page::{open_diagnosis, probability};
use crate::diagnose::report::sentence::lower_first;
use crate::paper::page::{close, escaped, figure, table, words};
use crate::paper::{Figures, Report};

/// Draws the report of an answer.
pub fn report(answer: &Answer, plates: &Plates) -> Report {
    let mut html = open_diagnosis(&answer.case, answer.verdict);
    let figures = section(&mut html, answer, plates, "h2");
    close(
        &mut html,
        "Simulation and effects pass through the same measurement as the data; missing data are never filled. Errors are one standard \
         error, with the memory of what is left in them.",
    );
    Report { html, figures }
}

/// Writes everything about one case on a page that may hold several; `heading` is the tag of its headings. Gives its figures.
pub fn section(out: &mut String, answer: &Answer, plates: &Plates, heading: &str) -> Vec<(String, String)> {
    let _ = writeln!(
        out,
        "<p class=\"under\">Verdict: {} · false-alarm probability {}</p>",
        answer.verdict.word(),
        probability(answer.false_alarm_probability)
    );
    let _ = writeln!(out, "<p class=\"sentence\">{}</p>", escaped(&sentence(answer)));
    let head = |out: &mut String, title: &str| {
        let _ = writeln!(out, "<{heading}>{title}</{heading}>");
    };
    if !answer.effects.is_empty() {
        head(out, "What the simulation lacks");
        effects(out, answer);
    }
    let (captions, drawn): (Vec<_>, Vec<_>) =
        figures::all(plates).into_iter().map(|(name, caption, svg)| ((name, caption), (name, svg))).unzip();
    let Figures { shown, missing } = Figures::of(drawn);
    for (name, caption) in captions {
        figure(out, &shown, name, caption);
    }
    head(out, "Does it predict?");
    predicts(out, answer);
    if answer.arcs.len() > 1 {
        head(out, "One by one");
        arcs(out, answer);
    }
    if !answer.upper_limits.is_empty() {
        head(out, "How small everything else must be");
        let rows = answer.upper_limits.iter().map(|l| vec![words(&l.id), format!("{:.2e}", l.limit), l.unit.clone()]);
        table(out, "", &["effect", "#below (95 %)", "unit"], rows);
    }
    if !answer.notes.is_empty() || !missing.is_empty() {
        head(out, "To know before trusting the figures");
        out.push_str("<ul>");
        for note in answer.notes.iter().chain(&missing) {
            let _ = write!(out, "<li>{}</li>", escaped(note));
        }
        out.push_str("</ul>\n");
    }
    shown
}

/// What is missing, and what is left, in a sentence or two.
pub fn sentence(answer: &Answer) -> String {
    let odd: Vec<&ArcAnswer> = answer.arcs.iter().filter(|a| a.verdict == Verdict::Unexplained).collect();
    let unit = &answer.unit;
    let mut names: Vec<String> = Vec::new();
    for name in answer.effects.iter().map(|e| lower_first(&e.name)) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let mut text = match (names.as_slice(), answer.verdict) {
        ([], Verdict::Unexplained) => {
            let most = odd.iter().map(|arc| arc.rms_after).fold(answer.fit.before.rms_total, f64::max);
            format!(
                "Recording and simulation differ by {} {unit}, and nothing in the catalogue explains it.",
                number(most)
            )
        }
        ([], _) => format!(
            "The simulation lacks nothing that shows: what is left, {} {unit} rms, follows nothing that was asked.",
            number(answer.fit.after.rms_total)
        ),
        _ => format!("The simulation lacks {}: {}.", listed(&names), falls(answer)),
    };
    if !odd.is_empty() && odd.len() < answer.arcs.len() {
        let ids: Vec<&str> = odd.iter().map(|arc| arc.id.as_str()).collect();
        let (stay, are) = if ids.len() == 1 { ("stays", "is") } else { ("stay", "are") };
        let _ = write!(text, " {} {stay} unexplained, and {are} given no cause.", ids.join(", "));
    }
    text
}

/// Satellites or axes that are told one by one.
const TOLD: usize = 4;

/// By how much the residual falls with all that is named, in the middle of those that have any of it; which they are, where others have none.
fn falls(answer: &Answer) -> String {
    let with: Vec<&ArcAnswer> = answer.arcs.iter().filter(|arc| !arc.effects.is_empty()).collect();
    let [was, is] = if with.is_empty() {
        [answer.fit.before.rms_total, answer.fit.after.rms_total]
    } else {
        [|arc: &ArcAnswer| arc.rms_before, |arc: &ArcAnswer| arc.rms_after]
            .map(|of| median(with.iter().map(|arc| of(arc))))
    };
    let whose = match with.len() {
        all if all == 0 || all == answer.arcs.len() => String::new(),
        few if few <= TOLD => format!(" of {}", with.iter().map(|arc| arc.id.as_str()).collect::<Vec<_>>().join(", ")),
        many => format!(" of {many} of {}", answer.arcs.len()),
    };
    format!("with it the residual{whose} falls from {} to {} {}", number(was), number(is), answer.unit)
}

fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [rest @ .., last] => format!("{} and {last}", rest.join("; ")),
    }
}

/// Three significant digits, with an exponent only where there must be one.
pub fn number(x: f64) -> String {
    match x.abs() {
        0.0 => "0".to_owned(),
        a if !a.is_finite() => "-".to_owned(),
        a if !(1e-4..1e5).contains(&a) => format!("{x:.2e}"),
        a => format!("{x:.*}", (2.0 - a.log10().floor()).clamp(0.0, 6.0) as usize),
    }
}

/// A value with its standard error, both to the error's second digit.
pub fn with_error(p: &ParameterAnswer) -> String {
    if p.sigma <= 0.0 || !p.sigma.is_finite() {
        return format!("{} {}", number(p.value), unit(p)).trim().to_owned();
    }
    let top = p.value.abs().max(p.sigma).log10().floor();
    let digits = (top - p.sigma.log10().floor() + 1.0).clamp(0.0, 8.0) as usize;
    if (-3.0..5.0).contains(&top) {
        let decimals = (1.0 - p.sigma.log10().floor()).clamp(0.0, 9.0) as usize;
        return format!("{:.decimals$} ± {:.decimals$} {}", p.value, p.sigma, unit(p)).trim().to_owned();
    }
    let scale = 10f64.powf(-top);
    format!("({:.digits$} ± {:.digits$})·1e{top:.0} {}", p.value * scale, p.sigma * scale, unit(p)).trim().to_owned()
}

fn unit(p: &ParameterAnswer) -> &str {
    if p.unit == "1" { "" } else { &p.unit }
}

fn effects(out: &mut String, answer: &Answer) {
    let rows = answer.effects.iter().map(|effect| {
        let own = |p: &ParameterAnswer| format!("{} {}", p.name, with_error(p));
        let axis = effect.axis.iter().map(|axis| format!("axis {axis}"));
        let all: Vec<String> = axis.chain(effect.parameters.iter().map(own)).collect();
        vec![effect.name.clone(), all.join("; "), effect.why.clone()]
    });
    table(out, "", &["what", "coefficients", "why"], rows);
}

fn predicts(out: &mut String, answer: &Answer) {
    if answer.steps.len() > 1 {
        let rows = answer.steps.iter().map(|step| {
            let added = step.added.as_deref().map_or("as the simulation stands".to_owned(), words);
            let predicted = step.predicted_rms.map_or("-".to_owned(), number);
            let score = step.score.map_or(String::new(), |s| format!("{s:.0}"));
            vec![added, number(step.rms), predicted, score]
        });
        let unit = &answer.unit;
        let heads =
            ["added", &format!("#rms of the fit, {unit}"), &format!("#rms of data not fitted, {unit}"), "#evidence"];
        table(out, "", &heads, rows);
    }
    let Some(held) = &answer.fit.held_out else {
        out.push_str("<p>No data were held back: all were fitted.</p>\n");
        return;
    };
    let list = |v: &[f64]| v.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", ");
    let log_score = match (held.log_score_gain, held.log_score_gain_se) {
        (Some(gain), Some(error)) if gain != 0.0 || error != 0.0 => {
            format!("; the log score rises by {} ± {}", number(gain), number(error))
        }
        _ => String::new(),
    };
    let _ = writeln!(
        out,
        "<p>On data not used for the fit ({}): {} before, {} after, {}{}.</p>",
        escaped(&held.scheme),
        list(&held.before_rms),
        list(&held.after_rms),
        escaped(&answer.unit),
        log_score
    );
}

fn arcs(out: &mut String, answer: &Answer) {
    let many = answer.arcs.len() > 8;
    let rows = answer.arcs.iter().map(|arc| {
        let coefficients = |effects: &[Effect]| {
            // A figure stays with its error and unit on one line.
            let figure = |p: &ParameterAnswer| with_error(p).replace(' ', "\u{a0}");
            // Of many satellites the first coefficient of each effect says enough, and the size of a velocity step: all are in diagnosis.json.
            let first = |effect: &Effect| effect.parameters.iter().position(|p| p.name == "dv_m_s").unwrap_or(0);
            let few =
                |effect: &Effect| if many { first(effect)..first(effect) + 1 } else { 0..effect.parameters.len() };
            let one = |effect: &Effect| {
                let told = effect.parameters.get(few(effect)).unwrap_or_default();
                told.iter().map(|p| format!("{}\u{a0}{}", p.name, figure(p))).collect::<Vec<_>>().join(", ")
            };
            effects.iter().map(one).collect::<Vec<_>>().join("; ")
        };
        vec![
            arc.id.clone(),
            arc.verdict.word().to_owned(),
            number(arc.rms_before),
            number(arc.rms_after),
            arc.predicted_rms.map_or("-".to_owned(), number),
            if many { coefficients(&arc.effects[..arc.effects.len().min(2)]) } else { coefficients(&arc.effects) },
            left(arc),
        ]
    });
    let unit = &answer.unit;
    let what = if many { "first coefficients" } else { "coefficients" };
    table(out, "", &["", "verdict", "#before", "#after", &format!("#not fitted, {unit}"), what, "what is left"], rows);
}

fn left(arc: &ArcAnswer) -> String {
    arc.note.clone().unwrap_or_default()
}
