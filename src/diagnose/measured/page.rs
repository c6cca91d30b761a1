//! These cases on paper: one self-contained page with its figures inside, like that of a flight recording.
//!
//! Every figure comes from the answer or its plates; nothing is computed here, and nothing written.

use std::fmt::Write;

use super::answer::{ArcAnswer, Effect};
use super::{Answer, Plates, figures};
use crate::diagnose::answer::{ParameterAnswer, Verdict};
use crate::diagnose::report::Report;
pub(crate) use crate::diagnose::report::page::STYLE;
use crate::diagnose::report::page::{escaped, figure_of, probability, table, verdict_word};
use crate::diagnose::report::sentence::words;

/// Draws the report of an answer.
pub fn report(answer: &Answer, plates: &Plates) -> Report {
    let mut page = String::new();
    let verdict = verdict_word(answer.verdict);
    let _ = write!(
        page,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>Diagnosis of {}: {verdict}</title><style>{STYLE}</style></head>\n<body class=\"{verdict}\">\n",
        escaped(&answer.case)
    );
    let _ = writeln!(page, "<h1>Recording against simulation: {}</h1>", escaped(&answer.case));
    page.push_str(&section(answer, plates, "h2"));
    page.push_str(
        "<footer><p>Simulation and effects pass through the same measurement as the data; missing data are never filled. Errors are \
         one standard error, with the memory of what is left in them.</p></footer>\n</body></html>\n",
    );
    let drawn = figures::all(plates);
    let figures = drawn.into_iter().filter_map(|(name, _, svg)| Some((name, svg.ok()?))).collect();
    Report { html: page, figures }
}

/// Everything about one case, for a page that may hold several; `heading` is the tag of its headings.
pub fn section(answer: &Answer, plates: &Plates, heading: &str) -> String {
    let mut out = String::new();
    let _ = writeln!(
        out,
        "<p class=\"under\">Verdict: {} · false-alarm probability {}</p>",
        verdict_word(answer.verdict),
        probability(answer.false_alarm_probability)
    );
    let _ = writeln!(out, "<p class=\"sentence\">{}</p>", escaped(&sentence(answer)));
    let head = |out: &mut String, title: &str| {
        let _ = writeln!(out, "<{heading}>{title}</{heading}>");
    };
    if !answer.effects.is_empty() {
        head(&mut out, "What the simulation lacks");
        effects(&mut out, answer);
    }
    let mut missing = Vec::new();
    for (name, caption, svg) in figures::all(plates) {
        match svg {
            Ok(svg) => figure_of(&mut out, &[(name, svg)], name, caption),
            Err(reason) => missing.push(format!("{name}: {reason}")),
        }
    }
    head(&mut out, "Does it predict?");
    predicts(&mut out, answer);
    if answer.arcs.len() > 1 {
        head(&mut out, "One by one");
        arcs(&mut out, answer);
    }
    if !answer.upper_limits.is_empty() {
        head(&mut out, "How small everything else must be");
        let rows = answer.upper_limits.iter().map(|l| vec![words(&l.id), format!("{:.2e}", l.limit), l.unit.clone()]);
        table(&mut out, &["effect", "#below (95 %)", "unit"], rows);
    }
    if !answer.notes.is_empty() || !missing.is_empty() {
        head(&mut out, "To know before trusting the figures");
        out.push_str("<ul>");
        for note in answer.notes.iter().chain(&missing) {
            let _ = write!(out, "<li>{}</li>", escaped(note));
        }
        out.push_str("</ul>\n");
    }
    out
}

/// What is missing, and what is left, in a sentence or two.
pub fn sentence(answer: &Answer) -> String {
    let odd: Vec<&str> =
        answer.arcs.iter().filter(|a| a.verdict == Verdict::Unexplained).map(|a| a.id.as_str()).collect();
    let (was, is) = (answer.fit.before.rms_total, answer.fit.after.rms_total);
    let names: Vec<String> = answer.effects.iter().map(|e| lower_first(&e.name)).collect();
    let mut text = match (names.as_slice(), answer.verdict) {
        ([], Verdict::Unexplained) => format!(
            "Recording and simulation differ by {} {}, and nothing in the catalogue explains it.",
            number(was),
            answer.unit
        ),
        ([], _) => format!("The simulation lacks nothing that {} {} would show.", number(is), answer.unit),
        _ => format!(
            "The simulation lacks {}: with it the residual falls from {} to {} {}.",
            listed(&names),
            number(was),
            number(is),
            answer.unit
        ),
    };
    if !odd.is_empty() && odd.len() < answer.arcs.len() {
        let _ = write!(text, " {} stays unexplained, and is given no cause.", odd.join(", "));
    }
    text
}

fn lower_first(name: &str) -> String {
    // A lone capital is a symbol.
    let mut letters = name.chars();
    match (letters.next(), letters.as_str()) {
        (Some(first), rest) if rest.starts_with(char::is_lowercase) => {
            first.to_lowercase().chain(rest.chars()).collect()
        }
        _ => name.to_owned(),
    }
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
    table(out, &["what", "coefficients", "why"], rows);
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
        table(out, &heads, rows);
    }
    let Some(held) = &answer.fit.held_out else {
        out.push_str("<p>No data were held back: all were fitted.</p>\n");
        return;
    };
    let list = |v: &[f64]| v.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", ");
    let _ = writeln!(
        out,
        "<p>On data not used for the fit ({}): {} before, {} after, {}.</p>",
        escaped(&held.scheme),
        list(&held.before_rms),
        list(&held.after_rms),
        escaped(&answer.unit)
    );
}

fn arcs(out: &mut String, answer: &Answer) {
    let many = answer.arcs.len() > 8;
    let rows = answer.arcs.iter().map(|arc| {
        let coefficients = |effects: &[Effect]| {
            // A figure stays with its error and unit on one line.
            let figure = |p: &ParameterAnswer| with_error(p).replace(' ', "\u{a0}");
            let one = |effect: &Effect| effect.parameters.first().map(figure).unwrap_or_default();
            effects.iter().map(one).collect::<Vec<_>>().join("; ")
        };
        vec![
            arc.id.clone(),
            verdict_word(arc.verdict).to_owned(),
            number(arc.rms_before),
            number(arc.rms_after),
            arc.predicted_rms.map_or("-".to_owned(), number),
            // Of many satellites the first coefficient of each effect says enough: all are in diagnosis.json.
            if many { coefficients(&arc.effects[..arc.effects.len().min(2)]) } else { coefficients(&arc.effects) },
            left(arc),
        ]
    });
    let unit = &answer.unit;
    let what = if many { "first coefficients" } else { "coefficients" };
    table(out, &["", "verdict", "#before", "#after", &format!("#not fitted, {unit}"), what, "what is left"], rows);
}

fn left(arc: &ArcAnswer) -> String {
    arc.note.clone().unwrap_or_default()
}
