//! Keeps the running diagnosis beside the products, on a thread of its own.
//!
//! It never stands in the way of the dump port: between two looks it waits on the hub's head, a slot that holds the latest
//! number only, so whatever came during a search is one picture afterwards, however much it was. The station is held for
//! as long as it takes to count the windows, or to copy them when a search is due; what derives from them derives afterwards, on
//! threads that derive no products. What it finds lies on the desk for those who ask, and waits at the hub for the one
//! writer to number, publish and journal it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

use tokio::runtime::Handle;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;

use super::others;
use crate::diagnose::case::Expectation;
use crate::diagnose::live::{Live, News, Policy, Report, State, digest, news};
use crate::diagnose::recorder;
use crate::hub::desk::{Desk, windows_seq};
use crate::hub::journal::Entry;
use crate::hub::wire::members;
use crate::hub::{Body, Hub, Topic};
use crate::ingest::priority::{SEARCHES_GIVE_WAY, give_way};
use crate::ingest::writer::SharedStation;
use crate::units::Clock;

/// Called before every search, on the thread that searches: whoever wants searches at certain times only holds it here.
pub type Gate = Arc<dyn Fn() + Send + Sync>;

/// Nothing came for this long: the windows so far are looked at, however few are new.
const QUIET: Duration = Duration::from_secs(5);
/// Time between two pictures of the windows, while they come.
const PAUSE: Duration = Duration::from_millis(250);

/// What the thread works on.
pub struct Diagnosing {
    /// The windows.
    pub station: SharedStation,
    /// Whose head tells that there are new ones, and who is told.
    pub hub: Arc<Hub>,
    /// Where the report lies.
    pub desk: Arc<Desk>,
    /// What the windows are compared with.
    pub expected: Expectation,
    /// When and how to look.
    pub policy: Policy,
    /// What an earlier run told of the same inputs.
    pub earlier: Option<Report>,
    /// Called before every search.
    pub gate: Gate,
    /// Cancelled when it must end; a search under way is given up within a second or so.
    pub stop: CancellationToken,
}

impl Diagnosing {
    /// Works until it is stopped.
    pub fn run(self, runtime: &Handle) {
        let Self { station, hub, desk, expected, policy, earlier, gate, stop } = self;
        let (case, inputs) = (expected.header.id.clone(), digest(&expected, &policy));
        let mut live = match Live::new(expected, policy, earlier.as_ref().map(Report::taken_up)) {
            Ok(live) => live,
            Err(error) => {
                tracing::error!(%error, "no diagnosis runs: the ancillary data defeat the physics");
                return desk.show(Report::refused(&case, inputs, error.to_string()), 0);
            }
        };
        let pool = match searchers() {
            Ok(pool) => pool,
            Err(error) => {
                tracing::error!(%error, "no diagnosis runs: there are no threads for its searches");
                let sentence = format!("There are no threads for searches: {error}");
                return desk.show(Report::refused(&case, inputs, sentence), 0);
            }
        };
        let mut teller = Teller { hub: hub.clone(), desk, told: earlier, windows_seq: 0 };
        let mut head = hub.subscribe();
        let mut is_coming = true;
        while !stop.is_cancelled() {
            head.mark_unchanged();
            teller.windows_seq = windows_seq(&hub);
            let seen = recorder::seen(&station.read().expect("no holder panics"), live.span_s());
            teller.tell(live.report(&seen, false));
            if !live.is_due(&seen, is_coming) {
                is_coming = runtime.block_on(something_new(&mut head, is_coming, &stop));
                continue;
            }
            // Of one moment: the windows that are copied are the ones that are counted.
            teller.windows_seq = windows_seq(&hub);
            let (seen, taken) = {
                let station = station.read().expect("no holder panics");
                let seen = recorder::seen(&station, live.span_s());
                (seen, recorder::taken(&station, live.span_to_take_s(&seen)))
            };
            teller.tell(live.report(&seen, true));
            // A search that panics is one answer less, and nothing else.
            let look = AssertUnwindSafe(|| {
                pool.install(|| {
                    gate();
                    live.look(seen, taken.recording(), is_coming, &|| stop.is_cancelled())
                })
            });
            let looked = catch_unwind(look).unwrap_or_else(|_| {
                tracing::error!(
                    windows = seen.windows,
                    "a search failed, by a defect of the program; the next goes on"
                );
                live.failed(seen);
                true
            });
            if looked {
                teller.tell(live.report(&seen, false));
            }
        }
    }
}

/// Tells of the diagnosis: the desk everything, the log and the readers of messages what is new.
struct Teller {
    hub: Arc<Hub>,
    desk: Arc<Desk>,
    /// What readers of messages know.
    told: Option<Report>,
    /// Last message about windows before they were counted.
    windows_seq: u64,
}

impl Teller {
    fn tell(&mut self, report: Report) {
        let is_there = !matches!(report.progress.state, State::Collecting | State::Searching);
        if is_there && report.is_news_after(self.told.as_ref()) {
            log(&self.hub, &news(self.told.as_ref(), &report));
            self.hub.tell(message(&report));
            self.told = Some(report.clone());
        }
        self.desk.show(report, self.windows_seq);
    }
}

/// The threads of the searches, who give way to everybody else: what derives products never waits behind a search, as it would where both
/// share their threads. One processor is left to those who answer.
fn searchers() -> Result<rayon::ThreadPool, rayon::ThreadPoolBuildError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(others()).thread_name(|n| format!("search-{n}"));
    pool.start_handler(|_| give_way(SEARCHES_GIVE_WAY)).build()
}

/// Waits for something new; false when nothing came for a while. Once that is known, it waits for as long as it takes.
async fn something_new(head: &mut watch::Receiver<u64>, is_coming: bool, stop: &CancellationToken) -> bool {
    let changed = async {
        match is_coming {
            true => tokio::time::timeout(QUIET, head.changed()).await.is_ok(),
            false => head.changed().await.is_ok(),
        }
    };
    let pause = async {
        let changed = changed.await;
        if changed {
            tokio::time::sleep(PAUSE).await;
        }
        changed
    };
    tokio::select! {
        () = stop.cancelled() => true,
        changed = pause => changed,
    }
}

/// One line in the log for everything that changed.
fn log(hub: &Hub, news: &[News]) {
    let (mission, spacecraft) = (hub.mission(), hub.spacecraft_id());
    for news in news {
        match news {
            News::Alarm { clock_s, verdict } => {
                tracing::warn!(
                    mission,
                    spacecraft,
                    clock_s,
                    verdict = verdict.word(),
                    "diagnosis: the alarm is raised"
                );
            }
            News::AlarmWithdrawn { clock_s } => {
                tracing::warn!(mission, spacecraft, clock_s, "diagnosis: the alarm is withdrawn");
            }
            News::Name { clock_s, name } => {
                tracing::warn!(
                    mission,
                    spacecraft,
                    clock_s,
                    name = name.join(" + "),
                    "diagnosis: what is missing has a name"
                );
            }
            News::NameWithdrawn { clock_s, name } => {
                tracing::warn!(
                    mission,
                    spacecraft,
                    clock_s,
                    name = name.join(" + "),
                    "diagnosis: the name is withdrawn"
                );
            }
            News::Refused { sentence } => {
                tracing::warn!(mission, spacecraft, sentence, "diagnosis: refused");
            }
            News::Beyond { windows } => {
                tracing::warn!(
                    mission,
                    spacecraft,
                    windows,
                    "diagnosis: windows come that are beyond what they are compared with"
                );
            }
        }
    }
}

/// The message on topic `diagnosis`: the report with its last look alone, for readers of messages have had those before.
fn message(report: &Report) -> Body {
    let mut report = report.clone();
    let looks = &mut report.progress.looks;
    looks.drain(..looks.len().saturating_sub(1));
    let clock_s = report.progress.last_clock_s.unwrap_or_default();
    let clock = Clock::from_tenths((clock_s * 10.0).round() as i64);
    Body::Told { topic: Topic::Diagnosis, clock, json: members("diagnosis", &report) }
}

/// What earlier runs told of the same inputs, out of the journal.
pub fn earlier(journal: &[Entry], expected: &Expectation, policy: &Policy) -> Option<Report> {
    let told = journal.iter().filter_map(|entry| match entry {
        Entry::Told { topic: Topic::Diagnosis, json, .. } => Some(format!("{{{json}}}")),
        _ => None,
    });
    Report::kept(&expected.header.id, digest(expected, policy), told)
}
