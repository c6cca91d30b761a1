//! Time and constants. SI inside; anything else carries its unit in its name.
//!
//! Not here: time scales of the Earth's rotation (see `physics`), formatting for the API (see `api`).

use jiff::Timestamp;

/// Standard gravity, m/s^2 (exact by definition, ISO 80000-3).
pub const STANDARD_GRAVITY_M_S2: f64 = 9.806_65;
/// One nano-g in m/s^2.
pub const NANO_G_M_S2: f64 = STANDARD_GRAVITY_M_S2 * 1e-9;
/// One micro-g in nano-g.
pub const NG_PER_UG: f64 = 1000.0;
/// Seconds in an hour.
pub const S_PER_H: f64 = 3600.0;

/// The instrument clock on its 0.1 s grid: tenths of a second since the instrument was powered on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Clock(i64);

impl Clock {
    /// From tenths of a second since power-on.
    pub const fn from_tenths(tenths: i64) -> Self {
        Self(tenths)
    }

    /// From a CUC time field: whole seconds and 2^-16 fractions, rounded to the 0.1 s grid (half up).
    pub const fn from_cuc(seconds: u32, fraction: u16) -> Self {
        Self(seconds as i64 * 10 + (fraction as i64 * 10 + 32_768) / 65_536)
    }

    /// The CUC field nearest to this clock: seconds and 2^-16 fractions. The clock must not be negative.
    pub const fn to_cuc(self) -> (u32, u16) {
        let tenths = self.0.rem_euclid(10);
        (self.0.div_euclid(10) as u32, ((tenths * 65_536 + 5) / 10) as u16)
    }

    /// Nearest grid point to a time in seconds.
    pub fn from_seconds(seconds: f64) -> Self {
        Self((seconds * 10.0).round() as i64)
    }

    /// Tenths of a second since power-on.
    pub const fn tenths(self) -> i64 {
        self.0
    }

    /// Seconds since power-on.
    pub fn seconds(self) -> f64 {
        self.0 as f64 / 10.0
    }

    /// This clock, later by so many tenths of a second.
    pub const fn plus_tenths(self, tenths: i64) -> Self {
        Self(self.0 + tenths)
    }
}

/// How the instrument clock relates to the mission and to UTC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MissionTime {
    /// UTC at instrument clock 0.
    pub epoch_utc: Timestamp,
    /// Instrument clock at lift-off, s.
    pub liftoff_clock_s: f64,
}

impl MissionTime {
    /// STS-65 [Rice 1996]: lift-off 1994-07-08 16:43:01 UTC, the instrument on 3 h 50 min (13,800 s) earlier.
    pub fn sts65() -> Self {
        Self { epoch_utc: Timestamp::constant(773_671_981, 0), liftoff_clock_s: 13_800.0 }
    }

    /// Mission elapsed time, s.
    pub fn met_s(&self, clock_s: f64) -> f64 {
        clock_s - self.liftoff_clock_s
    }

    /// Mission elapsed time in hours, the `t` of the bias law.
    pub fn met_h(&self, clock_s: f64) -> f64 {
        self.met_s(clock_s) / S_PER_H
    }

    /// UTC by the nominal epoch, to the millisecond.
    pub fn utc(&self, clock_s: f64) -> Timestamp {
        let ms = (clock_s * 1000.0).round() as i64;
        self.epoch_utc + jiff::SignedDuration::from_millis(ms)
    }

    /// Instrument clock of a UTC instant, s.
    pub fn clock_s(&self, utc: Timestamp) -> f64 {
        utc.duration_since(self.epoch_utc).as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sts65_epoch_is_the_published_lift_off_less_its_clock() {
        let liftoff: Timestamp = "1994-07-08T16:43:01Z".parse().unwrap();
        assert_eq!(MissionTime::sts65().utc(13_800.0), liftoff);
        assert_eq!(MissionTime::sts65().clock_s(liftoff), 13_800.0);
    }

    #[test]
    fn every_tenth_survives_the_cuc_field() {
        for tenths in 0..100_000 {
            let (seconds, fraction) = Clock::from_tenths(tenths).to_cuc();
            assert_eq!(Clock::from_cuc(seconds, fraction).tenths(), tenths);
        }
    }
}
