//! Records what comes in, as it becomes durable and is published.
//!
//! The recorder reads at its own pace, frames from the raw log and products from the hub, so it holds nobody up and misses
//! nothing; a window whose revisions came faster than they could be written is written in its newest one. A file that a crash left unfinished is dropped, and its span recorded anew.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::runtime::Handle;
use tokio_util::sync::CancellationToken;

use super::RecordError;
use super::mcap_file::Recording;
use crate::hub::status::{Board, count};
use crate::hub::{Hub, Reader, Step, Topic, Topics};
use crate::ingest::raw_log::RawLog;
use crate::pipeline::Settings;

/// A file is finished and the next one begun at this size.
const FILE_OCTETS_MAX: u64 = 512 << 20;
/// How often it is looked whether there is more.
const TICK: Duration = Duration::from_millis(50);
/// What could not be written is tried again after so long.
const RETRY: Duration = Duration::from_secs(5);
/// Products are taken up this often: at full speed a window is revised several times a second, and its newest revision is enough.
const PRODUCTS_EVERY: Duration = Duration::from_secs(1);
/// Messages taken from the hub at once.
const AT_ONCE: usize = 1024;

/// Up to where everything is recorded: batches of the raw log, messages of the hub.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
struct Position {
    batches: u64,
    seq: u64,
}

struct Open {
    recording: Recording<BufWriter<File>>,
    from: Position,
}

/// Writes recordings into a directory.
pub struct Recorder {
    directory: PathBuf,
    settings: Settings,
    log: Arc<RawLog>,
    hub: Arc<Hub>,
    reader: Reader,
    board: Arc<Board>,
    at: Position,
    /// Where it broke off last, until it is past that.
    broke_off: Option<Position>,
    open: Option<Open>,
}

/// A reader of what a recording has of the hub.
fn reader_after(hub: &Arc<Hub>, seq: u64) -> Reader {
    hub.reader(Topics::ALL.without(Topic::Raw), seq, None).newest_only()
}

impl Recorder {
    /// Takes up where the last finished recording ends.
    ///
    /// # Errors
    /// When the directory cannot be used.
    pub fn start(
        data_dir: &Path,
        settings: &Settings,
        log: Arc<RawLog>,
        hub: Arc<Hub>,
        board: Arc<Board>,
    ) -> Result<Self, RecordError> {
        let directory = data_dir.join("recordings");
        let failed = |source| RecordError::File { path: directory.clone(), source };
        fs::create_dir_all(&directory).map_err(failed)?;
        let mut at = Position::default();
        for entry in fs::read_dir(&directory).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if path.extension().is_some_and(|extension| extension == "part") {
                fs::remove_file(&path).map_err(failed)?;
            }
            at = path.file_name().and_then(|name| end_of(name.to_str()?)).map_or(at, |end| at.max(end));
        }
        let reader = reader_after(&hub, at.seq);
        Ok(Self { directory, settings: settings.clone(), log, hub, reader, board, at, broke_off: None, open: None })
    }

    /// Records until told to finish, and then what is left. What could not be written is written anew as soon as it can be; until then
    /// the board says so.
    ///
    /// # Errors
    /// When what is left at the end cannot be written.
    pub fn run(mut self, runtime: &Handle, finish: &CancellationToken) -> Result<(), RecordError> {
        loop {
            let Err(error) = self.record(runtime, finish) else { return Ok(()) };
            tracing::warn!(%error, "the recording broke off; it is written anew from where the last whole one ends");
            count(&self.board.counters.recording_faults, 1);
            self.board.tell_of_recording(Some(error.to_string()));
            self.begin_anew();
            if finish.is_cancelled() {
                return Err(error);
            }
            let _ = runtime.block_on(async { tokio::time::timeout(RETRY, finish.cancelled()).await });
        }
    }

    /// Drops the file that could not be written, and goes back to where it began.
    fn begin_anew(&mut self) {
        self.broke_off = self.broke_off.max(Some(self.at));
        if let Some(Open { from, .. }) = self.open.take() {
            self.at = from;
        }
        let _ = fs::remove_file(self.part_path());
        self.reader = reader_after(&self.hub, self.at.seq);
    }

    /// The same until something cannot be written or read.
    fn record(&mut self, runtime: &Handle, finish: &CancellationToken) -> Result<(), RecordError> {
        let mut products_read = Instant::now();
        loop {
            let finishing = finish.is_cancelled();
            let mut idle = true;
            while self.frames()? {
                idle = false;
            }
            if finishing || products_read.elapsed() > PRODUCTS_EVERY {
                while self.messages()? {}
                products_read = Instant::now();
                if self.broke_off.is_some_and(|at| self.at >= at) {
                    self.broke_off = None;
                    self.board.tell_of_recording(None);
                }
            }
            if finishing {
                return self.finish_file();
            }
            if self.file_octets() > FILE_OCTETS_MAX {
                self.finish_file()?;
            }
            if idle {
                let _ = runtime.block_on(async { tokio::time::timeout(TICK, finish.cancelled()).await });
            }
        }
    }

    fn part_path(&self) -> PathBuf {
        self.directory.join("recording.mcap.part")
    }

    fn file_octets(&self) -> u64 {
        if self.open.is_some() { fs::metadata(self.part_path()).map_or(0, |metadata| metadata.len()) } else { 0 }
    }

    fn write_failed(&self) -> impl Fn(mcap::McapError) -> RecordError + use<> {
        let path = self.part_path();
        move |source| RecordError::Write { path: path.clone(), source }
    }

    fn recording(&mut self) -> Result<&mut Recording<BufWriter<File>>, RecordError> {
        if self.open.is_none() {
            let path = self.part_path();
            let file = File::create(&path).map_err(|source| RecordError::File { path, source })?;
            let recording = Recording::begin(BufWriter::new(file), &self.settings).map_err(self.write_failed())?;
            self.open = Some(Open { recording, from: self.at });
        }
        Ok(&mut self.open.as_mut().expect("it was just opened").recording)
    }

    /// The next batch of frames; false when there is none.
    fn frames(&mut self) -> Result<bool, RecordError> {
        if self.at.batches >= self.log.batches() {
            return Ok(false);
        }
        let frames = self.log.first_arrivals(self.at.batches)?;
        let failed = self.write_failed();
        let recording = self.recording()?;
        for (playback, arrival) in &frames {
            recording.frame(*playback, arrival).map_err(&failed)?;
        }
        self.at.batches += 1;
        count(&self.board.counters.recorded, frames.len() as u64);
        Ok(true)
    }

    /// The next messages; false when there are none.
    fn messages(&mut self) -> Result<bool, RecordError> {
        let messages = match self.reader.next(AT_ONCE) {
            None => return Ok(false),
            // Only what fell out of the journal is missed: nothing more is known of it than its windows' later revisions.
            Some(Step::Lag { .. }) => Vec::new(),
            Some(Step::Messages(messages)) => messages,
        };
        if !messages.is_empty() {
            let failed = self.write_failed();
            let recording = self.recording()?;
            for message in &messages {
                recording.message(message).map_err(&failed)?;
            }
        }
        self.at.seq = self.reader.after();
        count(&self.board.counters.recorded, messages.len() as u64);
        Ok(true)
    }

    /// Finishes the file that is open. If that fails, it is as if nothing of it had been recorded.
    fn finish_file(&mut self) -> Result<(), RecordError> {
        let Some(Open { recording, from }) = self.open.take() else { return Ok(()) };
        let finished = self.finished(recording, from);
        if finished.is_err() {
            self.broke_off = self.broke_off.max(Some(self.at));
            self.at = from;
        }
        finished
    }

    fn finished(&self, recording: Recording<BufWriter<File>>, from: Position) -> Result<(), RecordError> {
        let part = self.part_path();
        let file = recording.finish().map_err(self.write_failed())?;
        let path = self.directory.join(name(from, self.at));
        let finished = file.into_inner().map_err(|error| error.into_error()).and_then(|file| file.sync_all());
        finished.and_then(|()| fs::rename(&part, &path)).map_err(|source| RecordError::File { path: part, source })
    }
}

/// `recording-b0-120-m0-51234.mcap`: batches and messages in it.
fn name(from: Position, to: Position) -> String {
    format!("recording-b{}-{}-m{}-{}.mcap", from.batches, to.batches, from.seq, to.seq)
}

/// Where the recording of a name ends.
fn end_of(name: &str) -> Option<Position> {
    let (batches, messages) = name.strip_prefix("recording-b")?.strip_suffix(".mcap")?.split_once("-m")?;
    let end = |span: &str| span.split_once('-')?.1.parse().ok();
    Some(Position { batches: end(batches)?, seq: end(messages)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_tells_where_the_recording_ends() {
        let (from, to) = (Position { batches: 3, seq: 40 }, Position { batches: 9, seq: 77 });
        assert_eq!(end_of(&name(from, to)), Some(to));
        assert_eq!(end_of("recording.mcap.part"), None);
    }
}
