//! The product: one window's quasi-steady acceleration in Orbiter body axes, with everything needed to trust it.

use std::fmt;

use crate::telemetry::{Mode, Quality, Range};
use crate::units::Clock;

/// Hash of what a window's product was made from: samples, calibration and configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Revision(pub u64);

impl fmt::Display for Revision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

/// The calibrated acceleration of one window on one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Component {
    /// From the adaptive trimmed mean, ng.
    pub trimmed_ng: f64,
    /// From the plain mean, ng.
    pub mean_ng: f64,
    /// One statistical standard error of `trimmed_ng`: noise, bias and scale factor, ng.
    pub sigma_ng: f64,
    /// The systematic part, to be added in quadrature, ng.
    pub sigma_sys_ng: f64,
}

/// The calibrated acceleration of one window on the Orbiter's body axes (+X tail to nose, +Y to starboard, +Z down through the belly). An
/// axis has none where its samples are at the rail, of more ranges than one, or without a calibration; that takes nothing from the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyAcceleration(pub [Option<Component>; 3]);

impl BodyAcceleration {
    /// All three components, or none.
    pub fn whole(&self) -> Option<[Component; 3]> {
        let [x, y, z] = self.0;
        Some([x?, y?, z?])
    }

    /// Whether an axis has a value.
    pub fn is_any(&self) -> bool {
        self.0.iter().any(Option::is_some)
    }

    /// A figure of each axis.
    pub fn each(&self, figure: impl Fn(&Component) -> f64) -> [Option<f64>; 3] {
        self.0.each_ref().map(|axis| axis.as_ref().map(&figure))
    }
}

/// One row of `windows.csv`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Product {
    /// Start of the 50 s window.
    pub start: Clock,
    /// What it measured, axis by axis.
    pub acceleration: BodyAcceleration,
    /// Q of the adaptive trimmed mean, per OARE axis; None when no sample was used or all were equal.
    pub q: [Option<f64>; 3],
    /// Trim fraction per end, per OARE axis.
    pub trim: [Option<f64>; 3],
    /// Range used, per OARE axis.
    pub range: [Option<Range>; 3],
    /// Samples of the window that came down (500 when whole).
    pub samples: u16,
    /// Mean sensor temperature, C.
    pub temperature_c: Option<f64>,
    /// What the instrument was doing.
    pub mode: Mode,
    /// Reasons for care.
    pub quality: Quality,
    /// Version of the calibration used.
    pub calibration: u32,
    /// Hash of what it was made from.
    pub revision: Revision,
    /// Latest instrument clock among the frames used.
    pub known_since: Clock,
}

/// How much older the last window with all three axes may be than the last with any, and still be the latest value: channels are at the
/// rail for seconds to minutes, and one that has no value for longer is itself the news.
const WHOLE_WITHIN_TENTHS: i64 = 6_000;

/// The latest value of products that come newest first: of the last window with all three axes, or of the last with any where none of ten
/// minutes has all.
pub fn latest<'a>(newest_first: impl Iterator<Item = &'a Product>) -> Option<&'a Product> {
    let mut newest: Option<&Product> = None;
    for product in newest_first.filter(|product| product.acceleration.is_any()) {
        let first = *newest.get_or_insert(product);
        if first.start.tenths() - product.start.tenths() > WHOLE_WITHIN_TENTHS {
            break;
        }
        if product.acceleration.whole().is_some() {
            return Some(product);
        }
    }
    newest
}
