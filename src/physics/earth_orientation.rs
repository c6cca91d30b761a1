//! Inertial to Earth-fixed, IAU 2006/2000A by the CIO method, with measured Earth orientation as an argument.
//!
//! Matrices come from `sofars`; nothing is read or downloaded here. Not here: sub-daily tidal variations of the pole
//! and of UT1 (up to 0.5 mas, 6 cm at 26,600 km), which the orbit's state fit absorbs for the most part.

use nalgebra::{Matrix3, Vector3};
use thiserror::Error;

/// TAI minus GPS time, s (exact).
pub const TAI_MINUS_GPS_S: f64 = 19.0;
/// TT minus TAI, s (exact).
pub const TT_MINUS_TAI_S: f64 = 32.184;
/// Seconds in a day.
pub const S_PER_DAY: f64 = 86_400.0;
const ARCSEC_RAD: f64 = std::f64::consts::PI / 648_000.0;
const MJD0_JD: f64 = 2_400_000.5;
/// Precession-nutation is tabulated at this spacing; its shortest term has a period of days.
const TABLE_STEP_S: f64 = 7_200.0;
/// Rows further apart than this are no daily table: the pole is then 1 mas off, a decimetre at a GPS orbit.
const HOLE_DAYS: f64 = 2.5;

/// Earth orientation that cannot be used.
#[derive(Debug, Error, PartialEq)]
pub enum EarthOrientationError {
    /// A line of the table does not hold six numbers.
    #[error("line {line}: expected mjd_utc, xp, yp, UT1-UTC, dx, dy, found {found:?}")]
    Line {
        /// Line number, from 1.
        line: usize,
        /// What was there.
        found: String,
    },
    /// A value that the Earth never has.
    #[error("line {line}: {what} is {found}, expected less than {most} {unit} either way")]
    Beyond {
        /// Line number, from 1.
        line: usize,
        /// Column.
        what: &'static str,
        /// What was there.
        found: f64,
        /// The most.
        most: f64,
        /// Unit of both.
        unit: &'static str,
    },
    /// The table is too short to interpolate.
    #[error("Earth orientation has {found} days, expected at least 2")]
    TooShort {
        /// Rows found.
        found: usize,
    },
    /// The table does not reach the recording.
    #[error("Earth orientation covers MJD {from} to {to}, and MJD {wanted:.3} is needed")]
    NotCovered {
        /// First day of the table.
        from: f64,
        /// Last day of the table.
        to: f64,
        /// The day asked for.
        wanted: f64,
    },
    /// The table has a hole where it is needed.
    #[error("Earth orientation has no row between MJD {from} and {to}, and MJD {wanted:.3} is needed")]
    Hole {
        /// Last day before the hole.
        from: f64,
        /// First day after it.
        to: f64,
        /// The day asked for.
        wanted: f64,
    },
    /// No leap seconds are known for this day.
    #[error("no TAI-UTC is known for MJD {mjd}")]
    NoLeapSeconds {
        /// The day asked for.
        mjd: f64,
    },
}

/// An instant of GPS time: whole days (modified Julian date) and seconds of the day, which may run past 86,400.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpsInstant {
    /// Modified Julian date of the day's start in GPS time.
    pub mjd: f64,
    /// Seconds since the day's start.
    pub s: f64,
}

impl GpsInstant {
    /// From a calendar date of GPS time.
    pub fn from_calendar(year: i32, month: u32, day: u32, s_of_day: f64) -> Option<Self> {
        let (_, mjd) = sofars::cal::cal2jd(year, month as i32, day as i32).ok()?;
        Some(Self { mjd, s: s_of_day })
    }

    /// Seconds from `earlier` to this instant.
    pub fn since_s(self, earlier: Self) -> f64 {
        (self.mjd - earlier.mjd) * S_PER_DAY + (self.s - earlier.s)
    }

    /// This instant, later by so many seconds.
    pub fn plus_s(self, s: f64) -> Self {
        Self { mjd: self.mjd, s: self.s + s }
    }

    /// Terrestrial Time as a two-part Julian date.
    pub fn tt_jd(self) -> (f64, f64) {
        (MJD0_JD + self.mjd, (self.s + TAI_MINUS_GPS_S + TT_MINUS_TAI_S) / S_PER_DAY)
    }

    /// UTC as a modified Julian date, for interpolation in tables (good to a leap second).
    pub fn utc_mjd(self) -> f64 {
        let leap_s = tai_minus_utc_s(self.mjd).unwrap_or(TAI_MINUS_GPS_S);
        self.mjd + (self.s + TAI_MINUS_GPS_S - leap_s) / S_PER_DAY
    }
}

/// TAI minus UTC on the day of this modified Julian date, s. A year beyond the table keeps the last value.
pub fn tai_minus_utc_s(mjd: f64) -> Result<f64, EarthOrientationError> {
    let missing = EarthOrientationError::NoLeapSeconds { mjd };
    let Ok((year, month, day, _)) = sofars::cal::jd2cal(MJD0_JD, mjd.floor()) else { return Err(missing) };
    sofars::ts::dat(year.min(2020), month, if month == 2 { day.min(28) } else { day }, 0.0).map_err(|_| missing)
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Row {
    mjd_utc: f64,
    /// xp, yp (rad), UT1-TAI (s: free of leap seconds), dX, dY (rad).
    value: [f64; 5],
}

/// Measured Earth orientation, one row a day.
#[derive(Debug, Clone, PartialEq)]
pub struct EarthOrientation {
    rows: Vec<Row>,
}

impl EarthOrientation {
    /// From `mjd_utc, xp_arcsec, yp_arcsec, ut1_minus_utc_s, dx_mas, dy_mas` with one header line.
    pub fn from_csv(text: &str) -> Result<Self, EarthOrientationError> {
        let mut rows = Vec::new();
        for (i, line) in text.lines().enumerate().skip(1).filter(|(_, line)| !line.trim().is_empty()) {
            let fields: Option<Vec<f64>> = line.split(',').map(|f| f.trim().parse().ok()).collect();
            let finite = fields.filter(|fields| fields.iter().all(|x: &f64| x.is_finite())).unwrap_or_default();
            let &[mjd_utc, xp, yp, ut1_utc, dx, dy] = finite.as_slice() else {
                return Err(EarthOrientationError::Line { line: i + 1, found: line.to_owned() });
            };
            // UTC is kept within 0.9 s of UT1, the pole is within a second of arc of its reference and some milliseconds of its model: another
            // unit is beyond these.
            for (what, found, most, unit) in [
                ("xp", xp, 1.0, "arcsec"),
                ("yp", yp, 1.0, "arcsec"),
                ("UT1-UTC", ut1_utc, 1.0, "s"),
                ("dx", dx, 100.0, "mas"),
                ("dy", dy, 100.0, "mas"),
            ] {
                if found.abs() >= most {
                    return Err(EarthOrientationError::Beyond { line: i + 1, what, found, most, unit });
                }
            }
            let ut1_tai = ut1_utc - tai_minus_utc_s(mjd_utc)?;
            let mas = ARCSEC_RAD / 1000.0;
            rows.push(Row { mjd_utc, value: [xp * ARCSEC_RAD, yp * ARCSEC_RAD, ut1_tai, dx * mas, dy * mas] });
        }
        rows.sort_by(|a, b| a.mjd_utc.total_cmp(&b.mjd_utc));
        rows.dedup_by(|a, b| a.mjd_utc == b.mjd_utc);
        match rows.len() {
            0 | 1 => Err(EarthOrientationError::TooShort { found: rows.len() }),
            _ => Ok(Self { rows }),
        }
    }

    /// Interpolated (cubic, linear where only two rows exist); up to one day beyond the table's ends is taken.
    fn at(&self, mjd_utc: f64) -> Result<[f64; 5], EarthOrientationError> {
        let (from, to) = (self.rows[0].mjd_utc, self.rows[self.rows.len() - 1].mjd_utc);
        if !(from - 1.0..=to + 1.0).contains(&mjd_utc) {
            return Err(EarthOrientationError::NotCovered { from, to, wanted: mjd_utc });
        }
        let width = self.rows.len().min(4);
        let after = self.rows.partition_point(|row| row.mjd_utc <= mjd_utc);
        if after > 0 && after < self.rows.len() {
            let (from, to) = (self.rows[after - 1].mjd_utc, self.rows[after].mjd_utc);
            if to - from > HOLE_DAYS {
                return Err(EarthOrientationError::Hole { from, to, wanted: mjd_utc });
            }
        }
        let start = after.saturating_sub(width / 2).min(self.rows.len() - width);
        let used = &self.rows[start..start + width];
        let nodes: Vec<f64> = used.iter().map(|row| row.mjd_utc).collect();
        let weights = lagrange_weights(&nodes, mjd_utc);
        Ok(std::array::from_fn(|k| used.iter().zip(&weights).map(|(row, w)| row.value[k] * w).sum()))
    }
}

/// Weights of Lagrange interpolation at `x` from values at `nodes`.
pub fn lagrange_weights(nodes: &[f64], x: f64) -> Vec<f64> {
    let weight = |i: usize| {
        let others = nodes.iter().enumerate().filter(|&(j, _)| j != i);
        others.map(|(_, node)| (x - node) / (nodes[i] - node)).product()
    };
    (0..nodes.len()).map(weight).collect()
}

/// The rotation over one stretch of time, tabulated once so that a force model can ask for it cheaply.
#[derive(Debug, Clone)]
pub struct Rotation {
    origin: GpsInstant,
    table_start_s: f64,
    /// X, Y, s, xp, yp, UT1-TAI at each table point.
    table: Vec<[f64; 6]>,
}

impl Rotation {
    /// For `span_s` seconds from `origin` (with a margin of hours on both sides).
    pub fn new(eop: &EarthOrientation, origin: GpsInstant, span_s: f64) -> Result<Self, EarthOrientationError> {
        let table_start_s = -2.0 * TABLE_STEP_S;
        let points = (span_s / TABLE_STEP_S).ceil() as usize + 5;
        let entry = |i: usize| {
            let instant = origin.plus_s(table_start_s + i as f64 * TABLE_STEP_S);
            let [xp, yp, ut1_tai, dx, dy] = eop.at(instant.utc_mjd())?;
            let (jd1, jd2) = instant.tt_jd();
            let (x, y) = sofars::pnp::xy06(jd1, jd2);
            Ok([x + dx, y + dy, sofars::pnp::s06(jd1, jd2, x, y), xp, yp, ut1_tai])
        };
        let table = (0..points).map(entry).collect::<Result<_, EarthOrientationError>>()?;
        Ok(Self { origin, table_start_s, table })
    }

    /// GCRS to ITRS at so many seconds after the origin: `r_itrs = M r_gcrs`.
    pub fn inertial_to_fixed(&self, t_s: f64) -> Matrix3<f64> {
        let [x, y, s, xp, yp, ut1_tai] = self.interpolate(t_s);
        let instant = self.origin.plus_s(t_s);
        let era = sofars::erst::era00(MJD0_JD + instant.mjd, (instant.s + TAI_MINUS_GPS_S + ut1_tai) / S_PER_DAY);
        let (jd1, jd2) = instant.tt_jd();
        let polar = sofars::pnp::pom00(xp, yp, sofars::pnp::sp00(jd1, jd2));
        let m = sofars::pnp::c2tcio(&sofars::pnp::c2ixys(x, y, s), era, &polar);
        Matrix3::from_fn(|i, j| m[i][j])
    }

    /// ITRS to GCRS of a position.
    pub fn to_inertial(&self, t_s: f64, fixed_m: &Vector3<f64>) -> Vector3<f64> {
        self.inertial_to_fixed(t_s).tr_mul(fixed_m)
    }

    fn interpolate(&self, t_s: f64) -> [f64; 6] {
        let u = (t_s - self.table_start_s) / TABLE_STEP_S;
        let start = (u.floor() as isize - 1).clamp(0, self.table.len() as isize - 4) as usize;
        let weights = lagrange_weights(&[0.0, 1.0, 2.0, 3.0], u - start as f64);
        std::array::from_fn(|k| (0..4).map(|i| weights[i] * self.table[start + i][k]).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EOP: &str = "mjd_utc,xp_arcsec,yp_arcsec,ut1_minus_utc_s,dx_mas,dy_mas\n\
        54194,0.0349282,0.4833163,-0.072073685,0.1750,-0.2259\n54195,0.0349282,0.4833163,-0.072073685,0.1750,-0.2259\n\
        54196,0.0349282,0.4833163,-0.072073685,0.1750,-0.2259\n";

    #[test]
    fn what_the_earth_never_has_is_refused_with_its_place() {
        // The pole in milliseconds of arc, UT1-UTC as TAI-UTC.
        for (had, has, said) in
            [("0.4833163", "483.3163", "line 2: yp is 483.3163"), ("-0.072073685", "33.1", "line 2: UT1-UTC is 33.1")]
        {
            let error = EarthOrientation::from_csv(&EOP.replacen(had, has, 1)).unwrap_err().to_string();
            assert!(error.starts_with(said), "{error}");
        }
    }

    #[test]
    fn the_rotation_is_that_of_the_sofa_cookbook() {
        // SOFA, "Tools for Earth Attitude", section 5.6: 2007 April 5 12:00 UTC, IAU 2006/2000A, CIO based, X and Y series.
        // GPS time was then 14 s ahead of UTC.
        let origin = GpsInstant::from_calendar(2007, 4, 5, 43_200.0 + 14.0).unwrap();
        let rotation = Rotation::new(&EarthOrientation::from_csv(EOP).unwrap(), origin, 3600.0).unwrap();
        let expected = Matrix3::new(
            0.973_104_317_697_512,
            0.230_363_826_239_128,
            -0.000_703_163_481_769,
            -0.230_363_800_456_036,
            0.973_104_570_632_801,
            0.000_118_545_368_117,
            0.000_711_560_162_594,
            0.000_046_626_402_444,
            0.999_999_745_754_024,
        );
        // 1e-11 is 0.3 mm at a GPS orbit; the cookbook's value is printed with 15 digits and interpolation costs some.
        assert!((rotation.inertial_to_fixed(0.0) - expected).abs().max() < 1e-11);
    }

    #[test]
    fn ut1_is_continuous_over_a_leap_second() {
        // UT1-UTC jumped by one second at the end of 2008, MJD 54832.
        let eop = EarthOrientation::from_csv(
            "h\n54830,0,0,-0.5903,0,0\n54831,0,0,-0.5911,0,0\n54832,0,0,0.4080,0,0\n54833,0,0,0.4071,0,0\n",
        )
        .unwrap();
        let before = eop.at(54_831.5).unwrap()[2];
        assert!((before - (-0.5911 - 33.0 - 0.0005)).abs() < 5e-4, "{before}");
    }

    #[test]
    fn a_day_outside_the_table_is_named() {
        let error = EarthOrientation::from_csv(EOP).unwrap().at(60_000.0).unwrap_err();
        assert_eq!(error.to_string(), "Earth orientation covers MJD 54194 to 54196, and MJD 60000.000 is needed");
    }
}
