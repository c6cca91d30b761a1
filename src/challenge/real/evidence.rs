//! The evidence as one JSON document and one page for people. Every figure on the page comes from the document.

use serde::Serialize;

use super::{NOTHING, Outcome, Score};
use crate::diagnose::measured::Answer;

/// What must stand beside every claim.
pub const LIMITS: &str = "No public low-frequency orbital accelerometer recording (OARE, MAMS, GRACE) was at hand: these recordings cover the same physics at the same level, and nothing is claimed beyond them.";

/// All of it.
#[derive(Debug, Clone, Serialize)]
pub struct Evidence {
    /// What this does not show.
    pub limits: &'static str,
    /// The lot, counted.
    pub score: Score,
    /// Every draw.
    pub draws: Vec<Outcome>,
    /// The cases as they stand, diagnosed whole.
    pub cases: Vec<Whole>,
}

/// One case, diagnosed as its `case.toml` says, and once more with part of it held back.
#[derive(Debug, Clone, Serialize)]
pub struct Whole {
    /// What was changed in `case.toml`.
    pub with: String,
    /// The answer.
    pub answer: Answer,
}

impl Evidence {
    /// The page.
    pub fn html(&self) -> String {
        let mut page = String::from(
            "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Real recordings: what was left out, and found</title>\
             <style>body{font:15px/1.5 sans-serif;max-width:70em;margin:2em auto;padding:0 1em}table{border-collapse:collapse;margin:1em 0}\
             td,th{border:1px solid #bbb;padding:.2em .6em;text-align:left;vertical-align:top}.no{background:#fdd}</style>\n",
        );
        page.push_str("<h1>Real recordings: what was left out, and found</h1>\n");
        page.push_str(&format!("<p><strong>{LIMITS}</strong></p>\n"));
        page.push_str(&self.lot());
        for whole in &self.cases {
            page.push_str(&whole_case(whole));
        }
        page.push_str(&self.table());
        page.push_str("</html>\n");
        page
    }

    fn lot(&self) -> String {
        let Score { removed, nothing, coefficients, commitment } = &self.score;
        let row =
            |what: &str, [good, of]: [usize; 2]| format!("<tr><td>{what}<td>{good} of {of}<td>{}", share(good, of));
        format!(
            "<h2>The lot</h2><p>Commitment published before the analysis: <code>{commitment}</code></p><table>{}{}{}</table>\n",
            row("a term taken out: named rightly, and nothing beside it", *removed),
            row("nothing taken out: answered with nothing", *nothing),
            row("coefficients within two standard errors of the full model's", *coefficients),
        )
    }

    fn table(&self) -> String {
        let mut out = String::from(
            "<h2>Every draw</h2><table><tr><th>#<th>recording<th>taken out<th>named<th>verdict<th>coefficients found<th>full model<th>rms before<th>after</tr>\n",
        );
        for draw in &self.draws {
            let list = |all: &[crate::diagnose::answer::ParameterAnswer]| {
                let one = |p: &crate::diagnose::answer::ParameterAnswer| {
                    format!("{} {:.3e} &plusmn; {:.1e}", escape(&p.name), p.value, p.sigma)
                };
                all.iter().map(one).collect::<Vec<_>>().join("<br>")
            };
            let named = if draw.named.is_empty() { NOTHING.to_owned() } else { draw.named.join(", ") };
            out.push_str(&format!(
                "<tr{}><td>{}<td>{}<td>{}<td>{named}<td>{}<td>{}<td>{}<td>{:.4e}<td>{:.4e}</tr>\n",
                if draw.right { "" } else { " class=\"no\"" },
                draw.truth.draw,
                escape(&draw.truth.subject),
                draw.truth.removed,
                draw.verdict,
                list(&draw.coefficients),
                list(&draw.truth.coefficients),
                draw.rms[0],
                draw.rms[1],
            ));
        }
        out.push_str("</table>\n");
        out
    }
}

fn share(good: usize, of: usize) -> String {
    if of == 0 { "-".to_owned() } else { format!("{:.1} %", 100.0 * good as f64 / of as f64) }
}

fn whole_case(whole: &Whole) -> String {
    let answer = &whole.answer;
    let mut out = format!("<h2>{} ({})</h2>\n", escape(&answer.case), escape(&whole.with));
    let verdict =
        serde_json::to_value(answer.verdict).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default();
    out.push_str(&format!(
        "<p>Verdict: <strong>{verdict}</strong>, chance of a false alarm {:.1e}.</p>\n",
        answer.false_alarm_probability
    ));
    if !answer.steps.is_empty() {
        out.push_str(&format!(
            "<table><tr><th>added<th>rms of the fit, {0}<th>rms of data not used for the fit, {0}</tr>",
            answer.unit
        ));
        for step in &answer.steps {
            let predicted = step.predicted_rms.map_or("-".to_owned(), |p| format!("{p:.4}"));
            out.push_str(&format!(
                "<tr><td>{}<td>{:.4}<td>{predicted}</tr>",
                step.added.as_deref().unwrap_or("(as it stands)"),
                step.rms
            ));
        }
        out.push_str("</table>\n");
    }
    out.push_str("<table><tr><th>effect<th>coefficients<th>why</tr>");
    for effect in &answer.effects {
        let one = |p: &crate::diagnose::answer::ParameterAnswer| {
            format!("{} = {:.4e} &plusmn; {:.1e} {}", escape(&p.name), p.value, p.sigma, escape(&p.unit))
        };
        let all: Vec<String> = effect.parameters.iter().map(one).collect();
        out.push_str(&format!("<tr><td>{}<td>{}<td>{}</tr>", effect.id, all.join("<br>"), escape(&effect.why)));
    }
    out.push_str("</table>\n<ul>");
    for note in &answer.notes {
        out.push_str(&format!("<li>{}</li>", escape(note)));
    }
    out.push_str("</ul>\n");
    out
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
