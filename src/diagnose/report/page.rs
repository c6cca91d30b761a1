//! The page: words and tables round the figures. One file, no script, nothing fetched; made to be printed.

use std::fmt::Write;

use super::Plates;
use super::sentence::{figure, sentence, words};
use crate::diagnose::answer::{Diagnosis, EffectAnswer, Verdict};

const STYLE: &str = "
:root { --ink: #222; --soft: #666; --rule: #d5d5d5; --claim: #b23a2e; }
* { box-sizing: border-box; }
body { font: 15px/1.5 Georgia, 'Times New Roman', serif; color: var(--ink); max-width: 900px; margin: 2.2em auto; padding: 0 1.2em; }
h1 { font-size: 1.55em; font-weight: normal; margin: 0 0 .1em; }
h2 { font-size: 1.1em; margin: 2em 0 .5em; border-bottom: 1px solid var(--rule); padding-bottom: .2em; }
p { margin: .5em 0; max-width: 48em; }
.under { color: var(--soft); margin: 0 0 1.2em; }
.sentence { font-size: 1.15em; border-left: 4px solid var(--claim); padding: .3em 0 .3em .9em; margin: 1em 0; max-width: 44em; }
.consistent .sentence { border-color: #4a7c59; }
table { border-collapse: collapse; margin: .6em 0 1em; font: 13.5px/1.45 Helvetica, Arial, sans-serif; font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: bold; border-bottom: 1.5px solid var(--ink); padding: .2em 1.4em .2em 0; }
td { border-bottom: 1px solid var(--rule); padding: .22em 1.4em .22em 0; vertical-align: top; }
td.n, th.n { text-align: right; }
figure { margin: 1em 0 1.4em; page-break-inside: avoid; break-inside: avoid; }
figure svg { width: 100%; height: auto; display: block; }
figcaption { color: var(--soft); font-size: .9em; max-width: 52em; }
.columns { columns: 2; column-gap: 3em; } .columns table { width: 100%; break-inside: auto; margin-top: 0; }
footer { margin-top: 3em; border-top: 1px solid var(--rule); color: var(--soft); font-size: .85em; }
@page { size: A4; margin: 16mm 15mm; }
@media print {
  body { font-size: 10.5pt; max-width: none; margin: 0; padding: 0; }
  h2 { break-after: avoid; } table, .sentence { break-inside: avoid; } tr { break-inside: avoid; }
  table { font-size: 9pt; }
}
";

/// The whole page.
pub fn page(d: &Diagnosis, plates: &Plates, figures: &[(&'static str, String)], missing: &[String]) -> String {
    let mut page = String::new();
    let verdict = verdict_word(d.verdict);
    let _ = write!(
        page,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>Diagnosis of {}: {verdict}</title><style>{STYLE}</style></head>\n<body class=\"{verdict}\">\n",
        escaped(&d.case)
    );
    let _ = writeln!(page, "<h1>Recording against simulation: {}</h1>", escaped(&d.case));
    let _ = writeln!(page, "<p class=\"under\">{}</p>", escaped(&under(d, plates)));
    let _ = writeln!(page, "<p class=\"sentence\">{}</p>", escaped(&sentence(d)));
    effects(&mut page, d);
    figure_of(
        &mut page,
        figures,
        "residual.svg",
        "Recording less simulation in body axes (10 min means, a constant per axis removed), \
        the claimed part over it, the Earth's shadow as bands, and the mission log below.",
    );
    figure_of(
        &mut page,
        figures,
        "after.svg",
        "What is left when the claimed part is taken away, on the scale of the figure above.",
    );
    held_out(&mut page, d);
    located(&mut page, d);
    figure_of(
        &mut page,
        figures,
        "covariates.svg",
        "Means over 24 bins of each quantity with their standard errors. What follows a quantity makes a slope or a shape; \
        what is left should not.",
    );
    figure_of(
        &mut page,
        figures,
        "spectrum.svg",
        "Amplitude of one sine at each frequency, in cycles per orbit, before (pale) and after (dark).",
    );
    competition(&mut page, d);
    figure_of(
        &mut page,
        figures,
        "ladder.svg",
        "Log evidence of the sets that were weighed, each with the noise refitted to what it leaves. \
        A difference of 5 is decisive, of 1 is not.",
    );
    limits(&mut page, d);
    notes(&mut page, d, missing);
    page.push_str(
        "<footer><p>Simulation and every signature pass through the same 50 s window mean as the data; missing data are never filled; \
         a constant per axis is not a finding. Errors are one standard error. Axes: X tail to nose, Y starboard, Z through the belly; \
         1 ng is 9.80665e-9 m/s&sup2;.</p></footer>\n</body></html>\n",
    );
    page
}

fn verdict_word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Consistent => "consistent",
        Verdict::Explained => "explained",
        Verdict::Ambiguous => "ambiguous",
        Verdict::Unexplained => "unexplained",
    }
}

fn under(d: &Diagnosis, plates: &Plates) -> String {
    let mut line = format!("Verdict: {}", verdict_word(d.verdict));
    let _ = write!(line, " · false-alarm probability {}", probability(d.false_alarm_probability));
    if let (Some(first), Some(last)) = (plates.clock_s.first(), plates.clock_s.last()) {
        let met = |t: &f64| (t - plates.liftoff_clock_s) / 3600.0;
        let _ =
            write!(line, " · {} windows, {:.1} to {:.1} h after lift-off", plates.clock_s.len(), met(first), met(last));
    }
    line
}

fn probability(p: f64) -> String {
    if p <= 0.0 || p >= 1e-3 { format!("{p:.3}") } else { format!("{p:.0e}") }
}

fn figure_of(page: &mut String, figures: &[(&'static str, String)], name: &str, caption: &str) {
    let Some((_, svg)) = figures.iter().find(|(n, _)| *n == name) else { return };
    // plotters writes width and height; the page scales by a view box.
    let svg = with_view_box(svg);
    let _ = writeln!(page, "<figure>{svg}<figcaption>{}</figcaption></figure>", escaped(caption));
}

fn with_view_box(svg: &str) -> String {
    let has_box = svg.get(..svg.find('>').unwrap_or(0)).is_some_and(|tag| tag.contains("viewBox"));
    if has_box {
        return svg.to_string();
    }
    let number =
        |key: &str| svg.split_once(&format!("{key}=\"")).and_then(|(_, rest)| rest.split_once('"')).map(|(n, _)| n);
    match (number("width"), number("height")) {
        (Some(w), Some(h)) => svg.replacen("<svg ", &format!("<svg viewBox=\"0 0 {w} {h}\" "), 1),
        _ => svg.to_string(),
    }
}

fn table(page: &mut String, head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) {
    page.push_str("<table><thead><tr>");
    for (k, cell) in head.iter().enumerate() {
        let _ = write!(page, "<th{}>{}</th>", class(k, head), escaped(cell.trim_start_matches('#')));
    }
    page.push_str("</tr></thead><tbody>");
    for row in rows {
        page.push_str("<tr>");
        for (k, cell) in row.iter().enumerate() {
            let _ = write!(page, "<td{}>{}</td>", class(k, head), escaped(cell));
        }
        page.push_str("</tr>");
    }
    page.push_str("</tbody></table>\n");
}

/// A heading that begins with `#` stands over numbers.
fn class(k: usize, head: &[&str]) -> &'static str {
    if head.get(k).is_some_and(|h| h.starts_with('#')) { " class=\"n\"" } else { "" }
}

fn effects(page: &mut String, d: &Diagnosis) {
    if d.effects.is_empty() {
        if let Some(h) = &d.hypothesis {
            page.push_str("<h2>A description, not a cause</h2>\n");
            table(
                page,
                &["formula", "axis", "unit", "where"],
                [vec![h.formula.clone(), h.axis.clone(), h.unit.clone(), h.location.clone()]],
            );
        }
        return;
    }
    page.push_str("<h2>What the simulation lacks</h2>\n");
    for effect in &d.effects {
        let _ = writeln!(
            page,
            "<p><b>{}</b> (probability {}){}. {}</p>",
            escaped(&effect.name),
            figure(effect.posterior),
            rms(effect),
            escaped(&effect.why)
        );
        let axis = effect.axis.iter().map(|a| vec!["axis".to_string(), a.clone(), String::new(), String::new()]);
        let numbers = effect.parameters.iter().map(|p| {
            let (value, sigma) = with_error(p.value, p.sigma);
            vec![p.name.clone(), value, sigma, p.unit.clone()]
        });
        table(page, &["parameter", "#value", "#standard error", "unit"], axis.chain(numbers));
    }
}

fn rms(effect: &EffectAnswer) -> String {
    effect.rms_ng.map_or(String::new(), |[x, y, z]| {
        format!(", {}, {} and {} ng rms on x, y, z", figure(x), figure(y), figure(z))
    })
}

/// Value and error to the error's second digit.
pub fn with_error(value: f64, sigma: f64) -> (String, String) {
    if sigma <= 0.0 || !sigma.is_finite() {
        return (figure(value), String::new());
    }
    let digits = (1.0 - sigma.log10().floor()).max(0.0) as usize;
    if digits > 7 || sigma.abs() >= 1e6 {
        return (format!("{value:.3e}"), format!("{sigma:.1e}"));
    }
    (format!("{value:.digits$}"), format!("{sigma:.digits$}"))
}

fn held_out(page: &mut String, d: &Diagnosis) {
    let Some(fit) = &d.fit else { return };
    page.push_str("<h2>Does it predict?</h2>\n");
    let row = |name: &str, v: [f64; 3], chi2: Option<f64>| {
        let mut row = vec![name.to_string()];
        row.extend(v.map(figure));
        row.push(chi2.map_or(String::new(), |c| format!("{c:.3}")));
        row
    };
    table(
        page,
        &["rms, ng", "#x", "#y", "#z", "#whitened chi² per degree"],
        [
            row("before", fit.before.rms_ng, Some(fit.before.whitened_chi2_per_dof)),
            row("after, same data", fit.after.rms_ng, Some(fit.after.whitened_chi2_per_dof)),
            row("before, data not seen", fit.held_out.before_rms_ng, None),
            row("after, data not seen", fit.held_out.after_rms_ng, None),
            row("noise alone", fit.noise_floor_ng, None),
        ],
    );
    let claimed = !d.effects.is_empty();
    let removed = if claimed {
        format!("{:.0} % of the excess over the noise is removed; ", 100.0 * fit.held_out.excess_removed)
    } else {
        String::new()
    };
    let _ = writeln!(
        page,
        "<p>Held out: {}. {removed}log score gained {} ± {}.</p>",
        escaped(&fit.held_out.scheme),
        figure(fit.held_out.log_score_gain),
        figure(fit.held_out.log_score_gain_se)
    );
}

fn located(page: &mut String, d: &Diagnosis) {
    let l = &d.located;
    if l.axes.is_empty() && l.intervals.is_empty() && l.covariates.is_empty() && l.per_orbit_lines.is_empty() {
        return;
    }
    page.push_str("<h2>Where the two differ</h2>\n");
    let mut rows = vec![vec!["axes".to_string(), l.axes.join(", ")]];
    if !l.frame.is_empty() {
        let along = l.direction.map_or(String::new(), |[x, y, z]| format!(", along ({x:.2}, {y:.2}, {z:.2})"));
        rows.push(vec!["steadiest frame".into(), format!("{}{along}", l.frame)]);
    }
    for interval in &l.intervals {
        rows.push(vec![
            format!("when: {}", interval.why),
            format!("{:.0} to {:.0} s", interval.start_s, interval.end_s),
        ]);
    }
    for covariate in &l.covariates {
        rows.push(vec![format!("follows {}", words(&covariate.name)), format!("score {}", figure(covariate.score))]);
    }
    for line in &l.per_orbit_lines {
        let place = format!("{} ng on {}", figure(line.amplitude_ng), line.axis);
        rows.push(vec![format!("line at {:.2} cycles per orbit", line.cycles_per_orbit), place]);
    }
    table(page, &["what", "where"], rows);
}

fn competition(page: &mut String, d: &Diagnosis) {
    if d.cannot_tell_apart.is_empty() && d.alternatives.is_empty() {
        return;
    }
    page.push_str("<h2>What else it could be</h2>\n");
    let joined = |set: &[String]| set.iter().map(|id| words(id)).collect::<Vec<_>>().join(" with ");
    if !d.cannot_tell_apart.is_empty() {
        page.push_str("<p>This recording cannot choose between:</p><ul>");
        for set in &d.cannot_tell_apart {
            let _ = write!(page, "<li>{}</li>", escaped(&joined(set)));
        }
        page.push_str("</ul>\n");
    }
    if let Some(s) = &d.separating_observation {
        let gain = s
            .gain
            .map_or(String::new(), |gain| format!(" It would separate them by {} standard errors.", figure(gain)));
        let (kind, text) = (escaped(&words(&s.kind)), escaped(&s.text));
        let _ = writeln!(page, "<p>The cheapest observation that would decide ({kind}): {text}{gain}</p>");
    }
    if !d.alternatives.is_empty() {
        let rows = d.alternatives.iter().map(|a| vec![joined(&a.effects), figure(a.posterior), figure(a.delta_bic)]);
        table(page, &["alternative", "#probability", "#lacks, in 2 ln evidence"], rows);
    }
}

fn limits(page: &mut String, d: &Diagnosis) {
    if d.upper_limits.is_empty() {
        return;
    }
    page.push_str("<h2>How small everything else must be</h2>\n<div class=\"columns\">");
    let mut limits: Vec<_> = d.upper_limits.iter().collect();
    limits.sort_by(|a, b| a.limit_ng.total_cmp(&b.limit_ng));
    let rows = limits.iter().map(|l| vec![words(&l.id), figure(l.limit_ng)]);
    table(page, &["effect", "#below, ng rms (95 %)"], rows);
    page.push_str("</div>\n");
}

fn notes(page: &mut String, d: &Diagnosis, missing: &[String]) {
    if d.notes.is_empty() && missing.is_empty() {
        return;
    }
    page.push_str("<h2>To know before trusting the figures</h2>\n<ul>");
    for note in d.notes.iter().chain(missing) {
        let _ = write!(page, "<li>{}</li>", escaped(note));
    }
    page.push_str("</ul>\n");
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
