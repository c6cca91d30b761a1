//! The running diagnosis as it stands: one immutable report at a time, taken over whole, so that nobody who asks waits for a search.

use std::sync::{Arc, RwLock};

use super::{Hub, Topic, Topics};
use crate::diagnose::live::Report;

/// Where the report lies; empty where no diagnosis runs.
#[derive(Debug, Default)]
pub struct Desk(RwLock<Option<Shown>>);

#[derive(Debug, Clone)]
struct Shown {
    report: Arc<Report>,
    /// Last message about windows that it knows.
    windows_seq: u64,
}

/// The last message about windows so far.
pub fn windows_seq(hub: &Hub) -> u64 {
    hub.last_seq_on(Topics::NONE.with(Topic::Window), hub.head_seq())
}

impl Desk {
    /// The report as it stands; at rest only as long as no window came after it was made.
    pub fn report(&self, hub: &Hub) -> Option<Arc<Report>> {
        let Shown { report, windows_seq: known } = self.0.read().expect("no holder panics").clone()?;
        if !report.progress.at_rest || windows_seq(hub) <= known {
            return Some(report);
        }
        let mut report = Report::clone(&report);
        report.progress.at_rest = false;
        Some(report.into())
    }

    /// Takes over a new report, which knows the messages about windows up to a number.
    pub fn show(&self, report: Report, windows_seq: u64) {
        *self.0.write().expect("no holder panics") = Some(Shown { report: Arc::new(report), windows_seq });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hub::{Body, SampleSource};
    use crate::telemetry::AccRecord;
    use crate::units::Clock;

    struct Nothing;

    impl SampleSource for Nothing {
        fn second(&self, _: Clock) -> Option<AccRecord> {
            None
        }
    }

    #[test]
    fn a_report_is_at_rest_until_a_window_comes_that_it_does_not_know() {
        let hub = Hub::new("sts-65", 0x41, 16, Arc::new(Nothing));
        let desk = Desk::default();
        let publish = |topic| {
            hub.publish(vec![Body::Told { topic, clock: Clock::from_tenths(0), json: r#""type":"x""#.into() }]);
        };
        let is_at_rest = || desk.report(&hub).unwrap().progress.at_rest;
        let mut report = Report::waiting("leak", 1);
        report.progress.at_rest = true;
        publish(Topic::Window);
        desk.show(report.clone(), windows_seq(&hub));
        assert!(is_at_rest());
        publish(Topic::Diagnosis);
        assert!(is_at_rest(), "what is told of the diagnosis is no window");
        publish(Topic::Window);
        assert!(!is_at_rest());
        desk.show(report, windows_seq(&hub));
        assert!(is_at_rest());
    }
}
