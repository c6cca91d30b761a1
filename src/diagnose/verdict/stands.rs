//! Whether a finding stands: it must predict what it has not seen, what it has not seen must not contradict it, and a placebo must
//! not do as well.
//!
//! Two figures of the blocks left out, since neither is enough. The log score shows a contradiction; but where the part fitted says
//! nothing of an amplitude, the prior leaves room for whatever the part left out shows, and that scores. The share of the effect
//! that is predicted there, if the part fitted can say anything of it, shows a confirmation. An attitude left out can confirm
//! nothing of an effect that happens in another.

use super::effect_of;
use crate::diagnose::answer::HeldOut;
use crate::diagnose::constancy::{Follows, follows_most};
use crate::diagnose::scene::Scene;
use crate::diagnose::search::Weighed;
use crate::diagnose::solve::Library;
use crate::diagnose::trial::{Trial, Tried};

/// Log score that a prediction may lose by chance; and the share of the evidence of the whole record that a contradiction by a part of
/// it must reach, lest one unlucky attitude overturn what all others say.
const PREDICTS: f64 = 2.0;
const OUTWEIGHS: f64 = 0.5;
/// Share of the energy of the effect in blocks held out that must be predicted. Right findings of SNR 5 to 8 predict more than half
/// where the other blocks can say it at all; what merely describes noise, or another law, often less than nothing.
const CONFIRMS: f64 = 0.3;
/// Log evidence (odds of four hundred) below which a finding must be confirmed; above, it must not be denied where it could be confirmed.
const WEAK: f64 = 6.0;
/// Log evidence by which a finding must be above its placebo: odds of twenty.
const ABOVE_PLACEBO: f64 = 3.0;

/// Log odds (of a hundred and fifty) from which on the size of a member follows something, and the share of its size that must.
const FOLLOWS: f64 = 5.0;
const FOLLOWS_SHARE: f64 = 0.2;

/// Why a set of effects is none of them, where the size of one is not the same throughout.
pub fn changes(scene: &Scene, library: &Library, weighed: &Weighed) -> Option<String> {
    let (frame, set) = weighed.framed(scene, &library.entries);
    let found = follows_most(scene, &frame, &library.entries, &set)?;
    let Follows { member, what, change, sigma, log_odds } = found;
    let id = effect_of(&library.entries, &set, member)?.id;
    let (percent, error) = (100.0 * change, 100.0 * sigma);
    (log_odds > FOLLOWS && change.abs() > FOLLOWS_SHARE).then(|| {
        format!(
            "the size of {id} is not the same throughout, but follows {what} ({percent:.0} ± {error:.0} % of it for a \
             standard deviation, log odds {log_odds:.1})"
        )
    })
}

/// A set on trial at its own noise.
pub fn tried(scene: &Scene, library: &Library, weighed: &Weighed) -> Tried {
    let (frame, set) = weighed.framed(scene, &library.entries);
    Trial::new(scene, &frame, &library.entries, &set, &weighed.noise).tried()
}

/// Why a finding of so much log evidence does not stand, if it does not.
pub fn fails(tried: &Tried, evidence: f64) -> Option<String> {
    let misleads = |held: &HeldOut| held.log_score_gain < -PREDICTS.max(OUTWEIGHS * evidence);
    if misleads(&tried.blocks) {
        return Some(format!(
            "it does not predict blocks it has not seen (log score {:.1})",
            tried.blocks.log_score_gain
        ));
    }
    let confirmed = if evidence < WEAK { Some(tried.blocks.excess_removed) } else { tried.confirmed };
    if let Some(share) = confirmed.filter(|share| *share < CONFIRMS) {
        return Some(format!("of the effect in blocks it has not seen it predicts a share of {share:.2}"));
    }
    if let Some(held) = tried.attitudes.as_ref().filter(|held| misleads(held)) {
        return Some(format!("it does not predict an attitude it has not seen (log score {:.1})", held.log_score_gain));
    }
    let above = tried.above_placebo.filter(|above| *above < ABOVE_PLACEBO)?;
    Some(format!("shifted in time its regressors score as well (log evidence {above:.1} above)"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(log_score_gain: f64) -> HeldOut {
        HeldOut {
            scheme: "alternate 6 h blocks".into(),
            before_rms_ng: [60.0; 3],
            after_rms_ng: [50.0; 3],
            excess_removed: 0.9,
            log_score_gain,
            log_score_gain_se: Some(5.0),
        }
    }

    #[test]
    fn a_finding_that_misleads_or_that_a_placebo_matches_is_refused_with_the_figure() {
        let tried = |blocks, attitudes: Option<f64>, above_placebo| Tried {
            blocks: held(blocks),
            confirmed: Some(0.9),
            attitudes: attitudes.map(held),
            above_placebo,
        };
        assert_eq!(fails(&tried(40.0, Some(12.0), Some(30.0)), 3.0), None);
        // One attitude, and no shift that is a placebo.
        assert_eq!(fails(&tried(40.0, None, None), 3.0), None);
        assert_eq!(fails(&tried(0.0, Some(-0.5), Some(3.5)), 3.0), None);
        for (tried, figure) in [
            (tried(-7.25, Some(12.0), Some(30.0)), "-7.2"),
            (tried(40.0, Some(-30.0), Some(30.0)), "-30.0"),
            (tried(40.0, Some(12.0), Some(1.5)), "1.5"),
        ] {
            assert!(fails(&tried, 3.0).is_some_and(|why| why.contains(figure)));
        }
        let mut unconfirmed = tried(41.7, Some(12.0), Some(30.0));
        unconfirmed.confirmed = None;
        unconfirmed.blocks.excess_removed = 0.04;
        assert_eq!(fails(&unconfirmed, 13.7), None);
        // What a single attitude says by chance does not outweigh what the whole record does.
        assert_eq!(fails(&tried(40.0, Some(-3.3), Some(30.0)), 13.7), None);
        assert!(fails(&unconfirmed, 3.0).is_some_and(|why| why.contains("a share of 0.04")));
    }
}
