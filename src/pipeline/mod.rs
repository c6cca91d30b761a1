//! Range, window, bias, scale factor, axes: from decoded records to calibrated body-axis samples.
//!
//! [`Station`] is the whole of it as one state machine: frames in, changes out, products at any time. It is a function of the
//! set of frames; nothing in it depends on the order in which they came.

pub mod archive;
pub mod axes;
pub mod calibration;
pub mod calibration_file;
pub mod derive;
pub mod files;
pub mod frames;
pub mod ledger;
pub mod product;
pub mod report;
pub mod settings;
pub mod station;
pub mod timeline;
pub mod window;

pub use ledger::{Ledger, PlaybackId};
pub use product::Product;
pub use settings::Settings;
pub use station::{Change, Station};
