//! MCAP recordings, written while the data come in and read again; product tables on demand.
//!
//! A recording is a copy: the raw log is the system of record, and every recording can be made again from it.

mod frame_time;
pub mod mcap_file;
pub mod mcap_reader;
pub mod recorder;
mod schema;
pub mod table;

use std::path::PathBuf;

pub use frame_time::frame_clock;

/// Why a recording or a table cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file system refuses.
    #[error("{}: {source}", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The MCAP container cannot be written.
    #[error("the recording {} cannot be written: {source}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the writer says.
        source: mcap::McapError,
    },
    /// The octets are no MCAP.
    #[error("not a readable MCAP file: {0}")]
    Read(mcap::McapError),
    /// An MCAP without raw frames of ours.
    #[error("the MCAP file has no topic {expected}: it is none of our recordings")]
    NoFrames {
        /// The topic looked for.
        expected: &'static str,
    },
    /// A frame message does not hold a frame.
    #[error("message {sequence} on {topic} holds no frame: {found}")]
    Frame {
        /// The topic.
        topic: &'static str,
        /// Which message.
        sequence: u32,
        /// What is wrong with it.
        found: String,
    },
    /// The raw log cannot be read.
    #[error("the raw log cannot be read: {0}")]
    Log(#[from] crate::ingest::raw_log::StoreError),
}
