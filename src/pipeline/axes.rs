//! From OARE axes to Orbiter body axes.
//!
//! OARE: +X tail to nose, +Y belly to top, +Z port to starboard. Body: +X tail to nose, +Y to starboard, +Z down through the
//! belly. a_body = (a_X, a_Z, -a_Y) [Rice 1996]. Everything refers to the sensor's place.

use super::calibration::Calibrated;
use super::product::{BodyAcceleration, Component};

/// The calibrated axes of the sensor, X, Y, Z, on body axes. Only a calibration makes one.
pub fn to_body([x, y, z]: [Option<Calibrated>; 3]) -> BodyAcceleration {
    BodyAcceleration([x.map(along), z.map(along), y.map(along).map(reversed)])
}

/// Figures of the sensor's axes that have no sign, as errors, on body axes: the same permutation.
pub fn errors_to_body([x, y, z]: [Option<f64>; 3]) -> [Option<f64>; 3] {
    [x, z, y]
}

fn along(axis: Calibrated) -> Component {
    Component {
        trimmed_ng: axis.trimmed_ng,
        mean_ng: axis.mean_ng,
        sigma_ng: axis.sigma_ng,
        sigma_sys_ng: axis.sigma_sys_ng,
    }
}

fn reversed(component: Component) -> Component {
    Component { trimmed_ng: -component.trimmed_ng, mean_ng: -component.mean_ng, ..component }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn the_rotation_is_proper_and_maps_the_named_directions() {
        let of = |ng: f64| Calibrated {
            trimmed_ng: ng,
            mean_ng: 2.0 * ng,
            sigma_ng: 3.0,
            sigma_sys_ng: 4.0,
            extrapolated: false,
        };
        let column = |v: [f64; 3]| {
            let axes = to_body(v.map(|ng| Some(of(ng)))).whole().unwrap();
            assert!(axes.iter().all(|a| a.mean_ng == 2.0 * a.trimmed_ng && a.sigma_ng == 3.0 && a.sigma_sys_ng == 4.0));
            Vector3::from(axes.map(|axis| axis.trimmed_ng))
        };
        let matrix =
            Matrix3::from_columns(&[column([1.0, 0.0, 0.0]), column([0.0, 1.0, 0.0]), column([0.0, 0.0, 1.0])]);
        assert_eq!(matrix.determinant(), 1.0);
        // Belly to top is up, which is -Z of the body; port to starboard is +Y.
        assert_eq!(column([0.0, 1.0, 0.0]), Vector3::new(0.0, 0.0, -1.0));
        assert_eq!(column([0.0, 0.0, 1.0]), Vector3::new(0.0, 1.0, 0.0));
        // An axis without a value takes nothing from the others.
        assert_eq!(to_body([Some(of(1.0)), None, Some(of(5.0))]).each(|c| c.trimmed_ng), [Some(1.0), Some(5.0), None]);
    }
}
