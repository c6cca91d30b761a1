//! What the case says of itself, held against what is known and what was found: claims are tested, not believed.

use crate::diagnose::answer::{EffectAnswer, Verdict};
use crate::diagnose::catalogue;
use crate::diagnose::scene::Scene;

/// Standard errors within which a fraction is that of a whole term.
const WHOLE: f64 = 2.0;
/// Standard error up to which it is said to be all of it.
const KNOWN: f64 = 0.1;
/// What a fraction of the whole term may lack for it to be called nearly whole, for the analyser's term is not the author's.
const NEARLY: f64 = 0.05;

/// A sentence for each key of `case.toml` that nothing reads.
pub fn of_unknown_keys(scene: &Scene) -> Vec<String> {
    let told = |key: String| format!("case.toml: `{key}` is no key of a case, and is not read");
    scene.case.header.unknown_keys().into_iter().map(told).collect()
}

/// A sentence for each claim of what is no effect.
pub fn of_unknown_claims(scene: &Scene) -> Vec<String> {
    let unknown = |token: &&String| !catalogue::ALL.iter().any(|effect| effect.id == token.as_str());
    let told = |token: &String| {
        format!(
            "case.toml says that the simulation includes {token}: that is none of the effects known, and is not tested"
        )
    };
    scene.case.header.includes.iter().filter(unknown).map(told).collect()
}

/// A sentence for each claim that does not hold.
pub fn of_claims(scene: &Scene, effects: &[EffectAnswer], verdict: Verdict) -> Vec<String> {
    let claimed = |effect: &&EffectAnswer| scene.case.header.includes.contains(&effect.id);
    let open = if verdict == Verdict::Ambiguous { ", if it is this" } else { "" };
    let told = |effect: &EffectAnswer| {
        let id = &effect.id;
        let claim = format!("case.toml says that the simulation includes {id}");
        let Some(p) = effect.parameters.iter().find(|p| p.name == "fraction") else {
            return format!("{claim}: the recording shows that it does not, or not enough of it{open}");
        };
        format!("{claim}: the recording shows that {}{open}", of_the_whole(p.value, p.sigma))
    };
    effects.iter().filter(claimed).map(told).collect()
}

/// What a fraction of a term and its standard error say is missing.
fn of_the_whole(fraction: f64, sigma: f64) -> String {
    let size = format!("{:.1} ± {:.1} %", 100.0 * fraction, 100.0 * sigma);
    let off = (fraction - 1.0).abs();
    match (off <= WHOLE * sigma, sigma <= KNOWN, off <= NEARLY) {
        (true, true, _) => format!("all of it is missing ({size})"),
        (false, _, true) => format!("nearly all of it is missing ({size})"),
        (true, false, _) => format!("it is off by {size} of the term, and may lack all of it"),
        (false, _, false) => format!("it is off by {size} of the term"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_of_a_term_is_missing_where_nothing_else_can_be() {
        assert_eq!(of_the_whole(0.996, 0.004), "all of it is missing (99.6 ± 0.4 %)");
        assert_eq!(of_the_whole(0.959, 0.005), "nearly all of it is missing (95.9 ± 0.5 %)");
        assert_eq!(of_the_whole(0.797, 0.159), "it is off by 79.7 ± 15.9 % of the term, and may lack all of it");
        assert_eq!(of_the_whole(0.729, 0.107), "it is off by 72.9 ± 10.7 % of the term");
    }
}
