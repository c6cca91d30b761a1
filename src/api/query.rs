//! Queries, and the times in them: clock seconds or RFC 3339.

use axum::extract::{FromRequestParts, Query};
use axum::http::request::Parts;
use jiff::Timestamp;
use serde::de::DeserializeOwned;

use super::problem::Problem;
use crate::units::{Clock, MissionTime};

/// Clocks beyond this are no times of a mission: a CUC time has 32 bits of seconds.
const CLOCK_S_MAX: f64 = 4_294_967_296.0;

/// The parameters of a query; what they cannot be is a problem as any other.
pub struct Asked<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Asked<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let read = Query::from_request_parts(parts, state).await;
        read.map(|Query(asked)| Self(asked)).map_err(|rejection| Problem::bad_request(rejection.body_text()))
    }
}

/// Reads a time; which parameter it is of stands in the sentence when it is none.
///
/// # Errors
/// A 400 problem naming the parameter and what was found.
pub fn clock(mission: &MissionTime, name: &str, text: &str) -> Result<Clock, Problem> {
    let clock_s = match text.parse::<f64>() {
        Ok(clock_s) => clock_s,
        Err(_) => match text.parse::<Timestamp>() {
            Ok(utc) => mission.clock_s(utc),
            Err(_) => {
                let detail =
                    format!("{name} is {text:?}; a time is clock seconds (13800.5) or RFC 3339 (1994-07-08T16:43:01Z)");
                return Err(Problem::bad_request(detail));
            }
        },
    };
    if !clock_s.is_finite() || clock_s.abs() > CLOCK_S_MAX {
        return Err(Problem::bad_request(format!("{name} is {text:?}, outside of the 32-bit instrument clock")));
    }
    Ok(Clock::from_seconds(clock_s))
}

/// As [`clock`], for a parameter that may be absent. One that is there and empty is a mistake: what it was to say is not known.
///
/// # Errors
/// As [`clock`].
pub fn optional_clock(mission: &MissionTime, name: &str, text: Option<&str>) -> Result<Option<Clock>, Problem> {
    text.map(|text| clock(mission, name, text)).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_a_clock_or_an_instant() {
        let mission = MissionTime::sts65();
        assert_eq!(clock(&mission, "from", "13800.5").unwrap().tenths(), 138_005);
        assert_eq!(clock(&mission, "from", "1994-07-08T16:43:01Z").unwrap().tenths(), 138_000);
        for nonsense in ["soon", "NaN", "inf", "1e300", "1994-07-08"] {
            assert!(clock(&mission, "from", nonsense).is_err(), "{nonsense}");
        }
        assert_eq!(optional_clock(&mission, "as_of", None).unwrap(), None);
        assert!(optional_clock(&mission, "as_of", Some("")).is_err(), "an empty one is no absent one");
    }
}
