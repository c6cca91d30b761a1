//! What came down as the recording of a case: a dump through the whole pipeline, its calibration estimated from the dump itself,
//! or the windows of a station as it stands.
//!
//! Only whole windows of normal mode with a calibration around them are used; where the records named a wrong range the
//! corrected value is. What the bias law leaves undecided is slow and the same in neighbouring windows: the noise model of the
//! diagnosis carries it as its slow component.

use std::fmt::Write;

use super::case::{Header, Recording};
use crate::ingest::wire::{PlaybackPart, PlaybackReader};
use crate::pipeline::station::{Station, replay};
use crate::pipeline::window::Window;
use crate::pipeline::{PlaybackId, Product, Settings};
use crate::telemetry::{Mode, Quality};
use crate::units::MissionTime;

/// OARE axis of each body axis.
const OARE_AXIS: [usize; 3] = [0, 2, 1];

/// The usable windows of a station, and what they are made of.
#[derive(Debug, Clone, Default)]
pub struct Usable {
    /// Calibrated windows, in order of time.
    pub recording: Recording,
    /// Digest of the revisions of their products: the same windows, the same digest.
    pub digest: u64,
    /// Version of the calibration they were made with; 0: none.
    pub calibration: u32,
}

/// The windows of a station that a diagnosis may use.
pub fn usable(station: &Station) -> Usable {
    let mut found = Usable { calibration: station.calibration().map_or(0, |c| c.version), ..Usable::default() };
    for (window, product) in station.windows().zip(station.products()) {
        let usable = product.quality == Quality::GOOD || product.quality == Quality::RANGE_CORRECTED;
        if usable && product.mode == Mode::Normal && push(&mut found.recording, station, window, product) {
            // Fowler, Noll and Vo's hash, a revision at a time: the windows come in one order.
            found.digest = (found.digest ^ product.revision.0).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
    found
}

/// The windows of a dump in the form of an `acceleration_csv` recording.
pub fn recording_csv(dump: &[u8], header: &Header) -> String {
    let time = MissionTime { epoch_utc: header.epoch_utc, liftoff_clock_s: header.liftoff_clock_s };
    let settings = Settings { time, ..Settings::sts65() };
    let station = replay(&settings, None, |station| take(station, &settings, dump));
    let Recording { clock_s, a_ng: [ax, ay, az], dev_ng: [dx, dy, dz] } = usable(&station).recording;
    let mut csv = String::from("clock_s,ax_ng,ay_ng,az_ng,dev_x_ng,dev_y_ng,dev_z_ng\n");
    for (i, clock_s) in clock_s.iter().enumerate() {
        let _ =
            writeln!(csv, "{clock_s:.1},{:.3},{:.3},{:.3},{:.3},{:.3},{:.3}", ax[i], ay[i], az[i], dx[i], dy[i], dz[i]);
    }
    csv
}

fn take(station: &mut Station, settings: &Settings, dump: &[u8]) {
    let mut reader = PlaybackReader::new(settings.link);
    let mut next = 0;
    let mut file = |part: PlaybackPart| match part {
        PlaybackPart::Opened => {
            next += 1;
            station.open_playback(PlaybackId(next));
        }
        PlaybackPart::Arrival(arrival) => station.take(PlaybackId(next), &arrival),
        PlaybackPart::Closed { bits } => station.close_playback(PlaybackId(next), bits),
    };
    reader.push(dump, &mut file);
    reader.finish(&mut file);
}

/// Adds one window, when all of its axes are calibrated; whether they are.
fn push(recording: &mut Recording, station: &Station, window: &Window, product: &Product) -> bool {
    let (Some(acceleration), Some(calibration)) = (&product.acceleration, station.calibration()) else { return false };
    let deviation_ng = OARE_AXIS.map(|axis| {
        let (window, range) = (window.axes[axis]?, product.range[axis]?);
        let ng = calibration.resolution_ng[axis][range.index()] * calibration.scale[axis][range.index()].correction;
        Some(window.estimate.deviation * ng)
    });
    let [Some(x), Some(y), Some(z)] = deviation_ng else { return false };
    recording.clock_s.push(window.centre_s());
    for (k, deviation) in [x, y, z].into_iter().enumerate() {
        recording.a_ng[k].push(acceleration.trimmed_ng.0[k]);
        recording.dev_ng[k].push(deviation);
    }
    true
}
