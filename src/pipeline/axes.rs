//! From OARE axes to Orbiter body axes.
//!
//! OARE: +X tail to nose, +Y belly to top, +Z port to starboard. Body: +X tail to nose, +Y to starboard, +Z down through the
//! belly. a_body = (a_X, a_Z, -a_Y) [Rice 1996]. Everything refers to the sensor's place.

use super::product::BodyVector;

/// Three components in OARE axes, calibrated, in ng. Only a calibration makes one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OareVector(pub [f64; 3]);

/// A calibrated acceleration in body axes.
pub fn to_body(OareVector([x, y, z]): OareVector) -> BodyVector {
    BodyVector([x, z, -y])
}

/// Standard errors in body axes: the same permutation, without its sign.
pub fn errors_to_body(OareVector([x, y, z]): OareVector) -> BodyVector {
    BodyVector([x, z, y])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn the_rotation_is_proper_and_maps_the_named_directions() {
        let column = |v: [f64; 3]| Vector3::from(to_body(OareVector(v)).0);
        let matrix =
            Matrix3::from_columns(&[column([1.0, 0.0, 0.0]), column([0.0, 1.0, 0.0]), column([0.0, 0.0, 1.0])]);
        assert_eq!(matrix.determinant(), 1.0);
        // Belly to top is up, which is -Z of the body; port to starboard is +Y.
        assert_eq!(column([0.0, 1.0, 0.0]), Vector3::new(0.0, 0.0, -1.0));
        assert_eq!(column([0.0, 0.0, 1.0]), Vector3::new(0.0, 1.0, 0.0));
    }
}
