//! The running diagnosis as it stands: one immutable report at a time, taken over whole, so that nobody who asks waits for a search.

use std::sync::{Arc, RwLock};

use crate::diagnose::live::Report;

/// Where the report lies; empty where no diagnosis runs.
#[derive(Debug, Default)]
pub struct Desk(RwLock<Option<Arc<Report>>>);

impl Desk {
    /// The report as it stands.
    pub fn report(&self) -> Option<Arc<Report>> {
        self.0.read().expect("no holder panics").clone()
    }

    /// Takes over a new report.
    pub fn show(&self, report: Report) {
        *self.0.write().expect("no holder panics") = Some(Arc::new(report));
    }
}
