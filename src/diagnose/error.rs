//! What can be wrong with a case, in one sentence each, with the value and its place.

/// Why a case cannot be analysed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CaseError {
    /// `case.toml` does not parse.
    #[error("case.toml: {0}")]
    Toml(String),
    /// A key is absent or of the wrong type.
    #[error("case.toml: `{key}` must be {expected}, found {found}")]
    Key {
        /// Dotted key.
        key: String,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// A file the case names was not given.
    #[error("{file}: the case names this file, but it is not there")]
    MissingFile {
        /// Its name.
        file: String,
    },
    /// A file is not named.
    #[error("case.toml: recording.file, simulation.file and ancillary.file must each name a file")]
    Unnamed,
    /// A file that is there and cannot be read.
    #[error("{file}: it is there and cannot be read: {reason}")]
    Unreadable {
        /// Its name.
        file: String,
        /// Why.
        reason: String,
    },
    /// A column is absent.
    #[error("{file}: no column `{column}`; the header has: {found}")]
    MissingColumn {
        /// File.
        file: String,
        /// Column wanted.
        column: String,
        /// Header found.
        found: String,
    },
    /// A cell is not a finite number.
    #[error("{file}, line {line}: `{column}` must be a finite number, found `{found}`")]
    NotANumber {
        /// File.
        file: String,
        /// Line, the header being 1.
        line: usize,
        /// Column.
        column: String,
        /// Cell.
        found: String,
    },
    /// A row has too few or too many cells, or the text is not CSV.
    #[error("{file}: {reason}")]
    Csv {
        /// File.
        file: String,
        /// The reader's reason.
        reason: String,
    },
    /// Times do not increase.
    #[error("{file}, line {line}: clock_s must increase, found {found} after {before}")]
    TimeOrder {
        /// File.
        file: String,
        /// Line, the header being 1.
        line: usize,
        /// This time.
        found: f64,
        /// The one before.
        before: f64,
    },
    /// Values cannot be in the unit the column promises.
    #[error(
        "{file}: `{column}` has a typical size of {found:.3e}, and {unit} between {low:e} and {high:e} is expected: is the unit right?"
    )]
    Unit {
        /// File.
        file: String,
        /// Column.
        column: String,
        /// Median of absolute values.
        found: f64,
        /// Unit expected.
        unit: &'static str,
        /// Lowest credible.
        low: f64,
        /// Highest credible.
        high: f64,
    },
    /// A column that is there more than once.
    #[error("{file}: the header has the column `{column}` {times} times")]
    RepeatedColumn {
        /// File.
        file: String,
        /// Column.
        column: String,
        /// How many times.
        times: usize,
    },
    /// A value that nothing can have.
    #[error("{file}, line {line}: `{column}` is {found:.3e}, and {unit} between {low:e} and {high:e} is expected")]
    Beyond {
        /// File.
        file: String,
        /// Line, the header being 1.
        line: usize,
        /// Column.
        column: String,
        /// The value.
        found: f64,
        /// Unit expected.
        unit: &'static str,
        /// Lowest credible.
        low: f64,
        /// Highest credible.
        high: f64,
    },
    /// An axis that never changes.
    #[error("{file}: `{column}` is {value} in all {rows} rows: a sensor that measures has noise")]
    Frozen {
        /// File.
        file: String,
        /// Column.
        column: String,
        /// Its one value.
        value: f64,
        /// Rows.
        rows: usize,
    },
    /// A grid too coarse, or with too long a hole, for what is left of the recording.
    #[error(
        "{file}: its grid is too coarse: {common} windows of the recording are between points less than {step_s} s apart \
         that a line can join, and at least {needed} are needed"
    )]
    TooCoarse {
        /// File.
        file: String,
        /// Longest step across which anything is compared, s.
        step_s: f64,
        /// Windows left.
        common: usize,
        /// Windows needed.
        needed: usize,
    },
    /// A dump without a window to compare.
    #[error(
        "{file}: no window of its {octets} octets is calibrated on all three axes: it is no dump, its calibrations are missing, or \
         case.epoch_utc and case.liftoff_clock_s are of another mission"
    )]
    NoWindows {
        /// File.
        file: String,
        /// Its length.
        octets: usize,
    },
    /// A span that ends before it begins.
    #[error("case.toml: `case.end_s` ({end_s} s) must be after `case.start_s` ({start_s} s)")]
    Span {
        /// Where it begins.
        start_s: f64,
        /// Where it ends.
        end_s: f64,
    },
    /// Two columns that contradict each other.
    #[error(
        "{file}: `{column}` is not how {other} change: its typical size is {found:.3e} {unit}, theirs {expected:.3e}, and what \
         they differ by {apart:.3e}"
    )]
    Contradiction {
        /// File.
        file: String,
        /// Columns given.
        column: String,
        /// Columns they are the rate of.
        other: &'static str,
        /// Unit.
        unit: &'static str,
        /// Median size given.
        found: f64,
        /// Median size of the change of the others.
        expected: f64,
        /// Median size of the difference.
        apart: f64,
    },
    /// A simulation that leaps from row to row by more than the recording's noise.
    #[error(
        "{file}: it changes too fast from row to row to be told from the recording's noise in all but {common} windows, and at \
         least {needed} are needed: is its grid too coarse, or one of the two in another unit?"
    )]
    TooRough {
        /// File.
        file: String,
        /// Windows left.
        common: usize,
        /// Windows needed.
        needed: usize,
    },
    /// Too little to work with.
    #[error("{file}: {found} rows, and at least {needed} are needed")]
    TooFew {
        /// File.
        file: String,
        /// Rows found.
        found: usize,
        /// Rows needed.
        needed: usize,
    },
    /// Recording and simulation do not meet.
    #[error(
        "the recording ({recording_start_s} to {recording_end_s} s) and {file} ({start_s} to {end_s} s) have {common} windows in common, and at least {needed} are needed"
    )]
    NoOverlap {
        /// First window.
        recording_start_s: f64,
        /// Last window.
        recording_end_s: f64,
        /// The other file.
        file: String,
        /// Its first instant.
        start_s: f64,
        /// Its last instant.
        end_s: f64,
        /// Windows in common.
        common: usize,
        /// Windows needed.
        needed: usize,
    },
    /// A kind of recording this room does not take.
    #[error(
        "case.toml: recording.kind `{0}` is not one of acceleration_csv, recorder_dump, orbit_sp3, series_csv, static_poses"
    )]
    Kind(String),
    /// The numbers defeat the estimation.
    #[error("{0}")]
    Numeric(String),
}

impl CaseError {
    /// The line it is about, where it is one.
    pub fn line_mut(&mut self) -> Option<&mut usize> {
        match self {
            Self::NotANumber { line, .. } | Self::TimeOrder { line, .. } | Self::Beyond { line, .. } => Some(line),
            _ => None,
        }
    }

    /// The file it is about, where it is one.
    pub fn file(&self) -> Option<&String> {
        match self {
            Self::MissingFile { file }
            | Self::Unreadable { file, .. }
            | Self::MissingColumn { file, .. }
            | Self::RepeatedColumn { file, .. }
            | Self::NotANumber { file, .. }
            | Self::Csv { file, .. }
            | Self::TimeOrder { file, .. }
            | Self::Unit { file, .. }
            | Self::Beyond { file, .. }
            | Self::Frozen { file, .. }
            | Self::TooCoarse { file, .. }
            | Self::TooRough { file, .. }
            | Self::NoWindows { file, .. }
            | Self::Contradiction { file, .. }
            | Self::TooFew { file, .. }
            | Self::NoOverlap { file, .. } => Some(file),
            Self::Unnamed | Self::Toml(_) | Self::Key { .. } | Self::Span { .. } | Self::Kind(_) | Self::Numeric(_) => {
                None
            }
        }
    }
}
