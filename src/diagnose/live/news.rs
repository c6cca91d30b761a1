//! What is new in a report of the running diagnosis: what an operator is told of once.

use super::progress::{Milestones, Report, State};
use crate::diagnose::answer::Verdict;

/// What changed from one report to another.
#[derive(Debug, Clone, PartialEq)]
pub enum News {
    /// An alarm stands that did not.
    Alarm {
        /// Last window of the look that raised it.
        clock_s: f64,
        /// What it says.
        verdict: Verdict,
    },
    /// An alarm no longer stands.
    AlarmWithdrawn {
        /// Last window of the look that took it back.
        clock_s: f64,
    },
    /// A name stands that did not.
    Name {
        /// Last window of the look that gave it.
        clock_s: f64,
        /// The effects.
        name: Vec<String>,
    },
    /// A name no longer stands, nor another one.
    NameWithdrawn {
        /// Last window of the look that took it back.
        clock_s: f64,
        /// The effects.
        name: Vec<String>,
    },
    /// The windows cannot be compared.
    Refused {
        /// Why.
        sentence: String,
    },
    /// Windows come that are beyond what they are compared with.
    Beyond {
        /// How many so far.
        windows: usize,
    },
}

/// What changed from the report told `before` to the one `after`.
pub fn news(before: Option<&Report>, after: &Report) -> Vec<News> {
    let nothing = Milestones::default();
    let (was, is) = (before.map_or(&nothing, |report| &report.progress.milestones), &after.progress.milestones);
    let at_s = after.progress.last_clock_s.unwrap_or_default();
    let mut news = Vec::new();
    if is.alarms_withdrawn > was.alarms_withdrawn {
        news.push(News::AlarmWithdrawn { clock_s: at_s });
    }
    if let (Some(clock_s), Some(answer)) = (is.alarm_clock_s.filter(|at| was.alarm_clock_s != Some(*at)), &after.answer)
    {
        news.push(News::Alarm { clock_s, verdict: answer.verdict });
    }
    match (&was.name, is.name_clock_s) {
        (name, Some(clock_s)) if *name != is.name => news.push(News::Name { clock_s, name: is.name.clone() }),
        (name, None) if !name.is_empty() => news.push(News::NameWithdrawn { clock_s: at_s, name: name.clone() }),
        _ => {}
    }
    let were_beyond = before.is_some_and(|report| report.progress.windows_beyond > 0);
    if after.progress.windows_beyond > 0 && after.progress.state != State::Refused && !were_beyond {
        news.push(News::Beyond { windows: after.progress.windows_beyond });
    }
    let was_refused = before.is_some_and(|report| report.progress.state == State::Refused);
    if after.progress.state == State::Refused && !was_refused {
        news.push(News::Refused { sentence: after.progress.sentence.clone() });
    }
    news
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::live::progress::tests::{named, take, told};

    #[test]
    fn alarm_name_refusal_and_withdrawal_are_told_once_each() {
        let silent = told(7, 1, Verdict::Consistent, 100.0);
        assert_eq!(news(None, &silent), []);
        let mut alarm = told(7, 2, Verdict::Unexplained, 200.0);
        let raised = News::Alarm { clock_s: 200.0, verdict: Verdict::Unexplained };
        assert_eq!(news(Some(&silent), &alarm), [raised]);
        assert_eq!(news(Some(&alarm), &alarm), []);
        let before = alarm.clone();
        take(&mut alarm.progress.milestones, Verdict::Explained, &["vent_leak"], 300.0, true);
        alarm.progress.last_clock_s = Some(300.0);
        assert_eq!(news(Some(&before), &alarm), [News::Name { clock_s: 300.0, name: named(&["vent_leak"]) }]);
        let mut gone = alarm.clone();
        take(&mut gone.progress.milestones, Verdict::Consistent, &[], 400.0, true);
        gone.progress.last_clock_s = Some(400.0);
        let name = named(&["vent_leak"]);
        let withdrawn = [News::AlarmWithdrawn { clock_s: 400.0 }, News::NameWithdrawn { clock_s: 400.0, name }];
        assert_eq!(news(Some(&alarm), &gone), withdrawn);
        let mut refused = Report { answer: None, ..alarm.clone() };
        (refused.progress.state, refused.progress.sentence) = (State::Refused, "No window is in common.".into());
        assert_eq!(news(Some(&alarm), &refused), [News::Refused { sentence: "No window is in common.".into() }]);
        assert_eq!(news(Some(&refused), &refused), []);
        let mut beyond = alarm.clone();
        beyond.progress.windows_beyond = 3;
        assert_eq!(news(Some(&alarm), &beyond), [News::Beyond { windows: 3 }]);
        assert_eq!(news(Some(&beyond), &beyond), []);
    }
}
