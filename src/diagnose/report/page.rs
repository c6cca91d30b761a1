//! The page: words and tables round the figures. One file, no script, nothing fetched; made to be printed.

use std::fmt::Write;

use super::Plates;
use super::sentence::{sentence, short};
use crate::diagnose::answer::{Diagnosis, EffectAnswer, HeldOut, Verdict};
use crate::paper::Figures;
use crate::paper::page::{close, escaped, figure, open, table, with_error, words};

/// The whole page.
pub fn page(d: &Diagnosis, plates: &Plates, Figures { shown: figures, missing }: &Figures) -> String {
    let mut page = open_diagnosis(&d.case, d.verdict);
    let _ = writeln!(page, "<p class=\"under\">{}</p>", escaped(&under(d, plates)));
    let _ = writeln!(page, "<p class=\"sentence\">{}</p>", escaped(&sentence(d)));
    effects(&mut page, d);
    figure(
        &mut page,
        figures,
        "residual.svg",
        "Recording less simulation in body axes (10 min means, a constant per axis removed), \
        what is fitted over it where anything is, the Earth's shadow as bands, and the mission log below.",
    );
    figure(
        &mut page,
        figures,
        "after.svg",
        "What is left when the fitted part is taken away, on the scale of the figure above.",
    );
    held_out(&mut page, d);
    located(&mut page, d);
    figure(
        &mut page,
        figures,
        "covariates.svg",
        "Means over 24 bins of each quantity with their standard errors. What follows a quantity makes a slope or a shape; \
        what is left should not.",
    );
    figure(
        &mut page,
        figures,
        "spectrum.svg",
        "Amplitude of one sine at each frequency, in cycles per orbit, before (pale) and after (dark).",
    );
    competition(&mut page, d);
    figure(
        &mut page,
        figures,
        "ladder.svg",
        "Log evidence of the sets that were weighed, each with the noise refitted to what it leaves. \
        A difference of 5 is decisive, of 1 is not.",
    );
    limits(&mut page, d);
    notes(&mut page, d, missing);
    close(
        &mut page,
        "Simulation and every signature pass through the same 50 s window mean as the data; missing data are never filled; a constant \
         per axis is not a finding. Errors are one standard error. Axes: X tail to nose, Y starboard, Z through the belly; 1 ng is \
         9.80665e-9 m/s&sup2;.",
    );
    page
}

/// Begins the page of a diagnosis.
pub(in crate::diagnose) fn open_diagnosis(case: &str, verdict: Verdict) -> String {
    let verdict = verdict.word();
    open(&format!("Diagnosis of {case}: {verdict}"), &format!("Recording against simulation: {case}"), "", verdict)
}

/// Share of an effect that one attitude must tell of another to be said to predict it.
const PREDICTED_LEAST: f64 = 0.05;

fn under(d: &Diagnosis, plates: &Plates) -> String {
    let mut line = format!("Verdict: {}", d.verdict.word());
    let _ = write!(line, " · false-alarm probability {}", probability(d.false_alarm_probability));
    if let Some(source) = d.false_alarm_from {
        let _ = write!(line, " ({})", source.words());
    }
    if let (Some(first), Some(last)) = (plates.clock_s.first(), plates.clock_s.last()) {
        let met = |t: &f64| (t - plates.liftoff_clock_s) / 3600.0;
        let _ = write!(
            line,
            " · {} windows, {:.1} to {:.1} h after lift-off · hours are since lift-off, instants in seconds of the instrument clock, by \
             which lift-off was at {} s",
            plates.clock_s.len(),
            met(first),
            met(last),
            plates.liftoff_clock_s
        );
    }
    line
}

/// A probability, with an exponent where it is below a thousandth.
pub(in crate::diagnose) fn probability(p: f64) -> String {
    if p <= 0.0 || p >= 1e-3 { format!("{p:.3}") } else { format!("{p:.0e}") }
}

fn effects(page: &mut String, d: &Diagnosis) {
    if d.effects.is_empty() {
        if let Some(h) = &d.hypothesis {
            page.push_str("<h2>A description, not a cause</h2>\n");
            table(
                page,
                "",
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
            short(effect.posterior),
            rms(effect),
            escaped(&effect.why)
        );
        let axis = effect.axis.iter().map(|a| vec!["axis".to_string(), a.clone(), String::new(), String::new()]);
        let numbers = effect.parameters.iter().map(|p| {
            let (value, sigma) = with_error(p.value, p.sigma);
            vec![p.name.clone(), value, sigma, p.unit.clone()]
        });
        table(page, "", &["parameter", "#value", "#standard error", "unit"], axis.chain(numbers));
    }
}

fn rms(effect: &EffectAnswer) -> String {
    effect
        .rms_ng
        .map_or(String::new(), |[x, y, z]| format!(", {}, {} and {} ng rms on x, y, z", short(x), short(y), short(z)))
}

/// What the log score gains on data not seen, with its error where there is one.
fn gain(held: &HeldOut) -> String {
    let error = held.log_score_gain_se.map_or(String::new(), |error| format!(" ± {}", short(error)));
    short(held.log_score_gain) + &error
}

fn held_out(page: &mut String, d: &Diagnosis) {
    let Some(fit) = &d.fit else { return };
    page.push_str("<h2>Does it predict?</h2>\n");
    let row = |name: &str, v: [f64; 3], chi2: Option<f64>| {
        let mut row = vec![name.to_string()];
        row.extend(v.map(short));
        row.push(chi2.map_or(String::new(), |c| format!("{c:.3}")));
        row
    };
    table(
        page,
        "",
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
    let removed = match fit.confirmed {
        _ if !claimed => String::new(),
        Some(_) => {
            format!("a fit to the other blocks gives {:.0} % of the effect; ", 100.0 * fit.held_out.excess_removed)
        }
        None => "the other blocks do not say how large the effect is; ".into(),
    };
    let _ = writeln!(
        page,
        "<p>Held out: {}. {removed}log score gained {}.</p>",
        escaped(&fit.held_out.scheme),
        gain(&fit.held_out)
    );
    if let Some(share) = fit.confirmed {
        let _ = writeln!(
            page,
            "<p>Of what the other blocks can say of the effect, they predict {:.1} %.</p>",
            100.0 * share
        );
    }
    if let Some(held) = fit.left_out_attitudes.as_ref().filter(|held| held.excess_removed < PREDICTED_LEAST) {
        let scheme = escaped(&held.scheme);
        let _ = writeln!(
            page,
            "<p>Attitudes ({scheme}): what is left in does not say how large this is in what is left out.</p>"
        );
    } else if let Some(held) = &fit.left_out_attitudes {
        let _ = writeln!(page, "<p>Attitudes: {}; log score gained {}.</p>", escaped(&held.scheme), gain(held));
    }
    if let Some(above) = fit.above_placebo {
        let _ = writeln!(
            page,
            "<p>Placebo: shifted in time, the same regressors score {} less in log evidence at best.</p>",
            short(above)
        );
    }
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
        rows.push(vec![format!("follows {}", words(&covariate.name)), format!("score {}", short(covariate.score))]);
    }
    for line in &l.per_orbit_lines {
        let place = format!("{} ng on {}", short(line.amplitude_ng), line.axis);
        rows.push(vec![format!("line at {:.2} cycles per orbit", line.cycles_per_orbit), place]);
    }
    table(page, "", &["what", "where"], rows);
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
        let (kind, text) = (escaped(&words(&s.kind)), escaped(&s.text));
        let _ = writeln!(page, "<p>What to observe next ({kind}): {text}</p>");
    }
    if !d.alternatives.is_empty() {
        let rows = d.alternatives.iter().map(|a| vec![joined(&a.effects), short(a.posterior), short(a.delta_bic)]);
        table(page, "", &["alternative", "#probability", "#lacks, in 2 ln evidence"], rows);
    }
}

fn limits(page: &mut String, d: &Diagnosis) {
    if d.upper_limits.is_empty() {
        return;
    }
    page.push_str("<h2>How small everything else must be</h2>\n<div class=\"columns\">");
    let mut limits: Vec<_> = d.upper_limits.iter().collect();
    limits.sort_by(|a, b| a.limit_ng.total_cmp(&b.limit_ng));
    let rows = limits.iter().map(|l| vec![words(&l.id), short(l.limit_ng)]);
    table(page, "", &["effect", "#below, ng rms (95 %)"], rows);
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
