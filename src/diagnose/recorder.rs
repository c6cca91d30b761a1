//! A recorder dump as the recording of a case: through the whole pipeline, its calibration estimated from the dump itself.
//!
//! Only whole windows of normal mode with a calibration around them are used; where the records named a wrong range the
//! corrected value is. What the bias law leaves undecided is slow and the same in neighbouring windows: the noise model of the
//! diagnosis carries it as its slow component.

use std::fmt::Write;

use super::case::Header;
use crate::ingest::wire::{PlaybackPart, PlaybackReader};
use crate::pipeline::station::{Station, replay};
use crate::pipeline::window::Window;
use crate::pipeline::{PlaybackId, Product, Settings};
use crate::telemetry::{Mode, Quality};
use crate::units::MissionTime;

/// OARE axis of each body axis.
const OARE_AXIS: [usize; 3] = [0, 2, 1];

/// The windows of a dump in the form of an `acceleration_csv` recording.
pub fn recording_csv(dump: &[u8], header: &Header) -> String {
    let time = MissionTime { epoch_utc: header.epoch_utc, liftoff_clock_s: header.liftoff_clock_s };
    let settings = Settings { time, ..Settings::sts65() };
    let station = replay(&settings, None, |station| take(station, &settings, dump));
    let mut csv = String::from("clock_s,ax_ng,ay_ng,az_ng,dev_x_ng,dev_y_ng,dev_z_ng\n");
    for (window, product) in station.windows().zip(station.products()) {
        let usable = product.quality == Quality::GOOD || product.quality == Quality::RANGE_CORRECTED;
        if usable && product.mode == Mode::Normal {
            row(&mut csv, &station, window, product);
        }
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

/// One window, when all of its axes are calibrated.
fn row(csv: &mut String, station: &Station, window: &Window, product: &Product) {
    let (Some(acceleration), Some(calibration)) = (&product.acceleration, station.calibration()) else { return };
    let deviation_ng = OARE_AXIS.map(|axis| {
        let (window, range) = (window.axes[axis]?, product.range[axis]?);
        let ng = calibration.resolution_ng[axis][range.index()] * calibration.scale[axis][range.index()].correction;
        Some(window.estimate.deviation * ng)
    });
    let [Some(x), Some(y), Some(z)] = deviation_ng else { return };
    let [ax, ay, az] = acceleration.trimmed_ng.0;
    let _ = writeln!(csv, "{:.1},{ax:.3},{ay:.3},{az:.3},{x:.3},{y:.3},{z:.3}", window.centre_s());
}
