//! What the case says of itself, held against what is known and what was found: claims are tested, not believed.

use crate::diagnose::answer::{EffectAnswer, Verdict};
use crate::diagnose::catalogue;
use crate::diagnose::scene::Scene;

/// Standard errors within which a fraction is that of a whole term.
const WHOLE: f64 = 3.0;
/// What a fraction of the whole term may lack for it to be called whole however small its error, for the analyser's term is not the author's.
const WHOLE_WITHIN: f64 = 0.05;

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
        let (percent, error) = (100.0 * p.value, 100.0 * p.sigma);
        match (p.value - 1.0).abs() <= (WHOLE * p.sigma).max(WHOLE_WITHIN) {
            true => {
                format!("{claim}: the recording shows that all of it is missing ({percent:.1} ± {error:.1} %){open}")
            }
            false => {
                format!("{claim}: the recording shows that it is off by {percent:.1} ± {error:.1} % of the term{open}")
            }
        }
    };
    effects.iter().filter(claimed).map(told).collect()
}
