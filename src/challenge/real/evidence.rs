//! The evidence as one JSON document and one page for people. Every figure on the page comes from the document.

use std::fmt::Write;

use serde::Serialize;

use super::{NOTHING, Outcome, Score};
use crate::diagnose::answer::ParameterAnswer;
use crate::diagnose::measured::page::{number, section, with_error};
use crate::diagnose::measured::{Answer, Plates};
use crate::paper::page::{close, escaped, open, words};

/// What this page has beside a case's own.
const MORE: &str = "
h2.case { font-size: 1.3em; margin-top: 2.6em; } h3 { font-size: 1em; margin: 1.6em 0 .3em; }
tr.sum td { font-weight: bold; } tr.no td { background: #fbe4e1; } table.draws { font-size: 12px; }
code { font-size: .8em; overflow-wrap: anywhere; }
@media print { h2.case { break-before: page; } h3 { break-after: avoid; } table.draws, table { break-inside: auto; } table.draws { font-size: 7.5pt; } }
";

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
    /// The page; the plates are those of the cases, in their order.
    pub fn html(&self, plates: &[Plates]) -> String {
        let title = "Real recordings: what was left out, and found";
        let mut page = open(title, title, MORE, "");
        let _ = writeln!(page, "<p class=\"sentence\">{}</p>", escaped(&self.summary()));
        let _ = writeln!(page, "<p>{LIMITS}</p>");
        self.lot(&mut page);
        for (whole, plates) in self.cases.iter().zip(plates) {
            let _ = writeln!(page, "<h2 class=\"case\">{}, {}</h2>", escaped(&whole.answer.case), escaped(&whole.with));
            section(&mut page, &whole.answer, plates, "h3");
        }
        self.table(&mut page);
        close(&mut page, "");
        page
    }

    fn summary(&self) -> String {
        let Score { removed, nothing, coefficients, .. } = &self.score;
        format!(
            "A term was taken out of the simulation by lot {} times, and named rightly and alone {} times; nothing was taken out {} \
             times, and nothing named {} times. Of {} coefficients {} lie within two standard errors of the full model's.",
            removed[1], removed[0], nothing[1], nothing[0], coefficients[1], coefficients[0]
        )
    }

    fn lot(&self, page: &mut String) {
        let _ = writeln!(
            page,
            "<h2>The lot</h2>\n<p>The analyser sees a recording and what is left of its simulation, never the lot. Published before \
             the analysis, as a hash over all lots: <code>{}</code></p>\n<p>The full model's coefficients come from the same recordings: \
             that they are met tests the search and its errors, and is no second measurement.</p>",
            self.score.commitment
        );
        let mut terms: Vec<&str> = self.draws.iter().map(|d| d.truth.removed.as_str()).collect();
        terms.sort_unstable();
        terms.dedup();
        page.push_str(
            "<table><thead><tr><th>taken out</th><th class=\"n\">drawn</th><th class=\"n\">answered rightly</th>\
             <th class=\"n\">coefficients within 2 sigma</th></tr></thead><tbody>\n",
        );
        for term in terms {
            let of: Vec<&Outcome> = self.draws.iter().filter(|d| d.truth.removed == term).collect();
            let right = of.iter().filter(|d| d.right).count();
            let [within, compared] = of.iter().fold([0, 0], |[a, b], d| [a + d.within[0], b + d.within[1]]);
            let coefficients = if compared > 0 { format!("{within} of {compared}") } else { String::new() };
            let _ = writeln!(
                page,
                "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{right}</td><td class=\"n\">{coefficients}</td></tr>",
                escaped(&words(term)),
                of.len()
            );
        }
        let Score { removed, nothing, coefficients, .. } = &self.score;
        let right = removed[0] + nothing[0];
        let _ = writeln!(
            page,
            "<tr class=\"sum\"><td>all</td><td class=\"n\">{}</td><td class=\"n\">{right} ({})</td>\
             <td class=\"n\">{} of {} ({})</td></tr></tbody></table>",
            self.draws.len(),
            share(right, self.draws.len()),
            coefficients[0],
            coefficients[1],
            share(coefficients[0], coefficients[1])
        );
    }

    fn table(&self, page: &mut String) {
        page.push_str(
            "<h2 class=\"case\">Every draw</h2>\n<table class=\"draws\"><thead><tr><th class=\"n\">#</th><th>recording</th>\
             <th>taken out</th><th>named</th><th>found</th><th>full model</th><th class=\"n\">rms before</th>\
             <th class=\"n\">after</th></tr></thead><tbody>\n",
        );
        for draw in &self.draws {
            let list = |all: &[ParameterAnswer]| {
                let one = |p: &ParameterAnswer| escaped(&with_error(p));
                all.iter().map(one).collect::<Vec<_>>().join("<br>")
            };
            let named = if draw.named.is_empty() { NOTHING.to_owned() } else { draw.named.join(", ") };
            let _ = writeln!(
                page,
                "<tr{}><td class=\"n\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"n\">{}</td>\
                 <td class=\"n\">{}</td></tr>",
                if draw.right { "" } else { " class=\"no\"" },
                draw.truth.draw,
                escaped(&draw.truth.subject),
                escaped(&words(&draw.truth.removed)),
                escaped(&words(&named)),
                list(&draw.coefficients),
                list(&draw.truth.coefficients),
                number(draw.rms[0]),
                number(draw.rms[1]),
            );
        }
        page.push_str("</tbody></table>\n");
    }
}

fn share(good: usize, of: usize) -> String {
    if of == 0 { "-".to_owned() } else { format!("{:.1} %", 100.0 * good as f64 / of as f64) }
}
