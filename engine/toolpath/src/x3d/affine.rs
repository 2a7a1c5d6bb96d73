//! Rotations and the matrix of a Transform node, without the platform's sine: equal bytes on every machine.

use glam::{DAffine3, DMat3, DVec3};

/// Axes shorter than this turn nothing: "0 0 0 angle" is found in the wild.
const AXIS_MIN: f64 = 1e-12;

/// Rotation about an axis of any length by an angle in radians, right-handed (an X3D SFRotation).
pub(super) fn rotation([x, y, z, angle]: [f64; 4]) -> DMat3 {
    let axis = DVec3::new(x, y, z);
    let length = axis.length();
    // A comparison that a NaN fails as well.
    if angle == 0.0 || length.partial_cmp(&AXIS_MIN) != Some(std::cmp::Ordering::Greater) {
        return DMat3::IDENTITY;
    }
    let DVec3 { x, y, z } = axis / length;
    let (sin, cos) = libm::sincos(angle);
    let versed = 1.0 - cos;
    DMat3::from_cols(
        DVec3::new(cos + x * x * versed, y * x * versed + z * sin, z * x * versed - y * sin),
        DVec3::new(x * y * versed - z * sin, cos + y * y * versed, z * y * versed + x * sin),
        DVec3::new(x * z * versed + y * sin, y * z * versed - x * sin, cos + z * z * versed),
    )
}

/// The fields of a Transform node that move its children (ISO/IEC 19775-1, 10.4.4).
#[derive(Clone, Copy, Debug)]
pub(super) struct Transform {
    pub(super) translation: [f64; 3],
    pub(super) center: [f64; 3],
    pub(super) rotation: [f64; 4],
    pub(super) scale: [f64; 3],
    pub(super) scale_orientation: [f64; 4],
}

impl Default for Transform {
    fn default() -> Transform {
        let none = [0.0, 0.0, 1.0, 0.0];
        Transform {
            translation: [0.0; 3],
            center: [0.0; 3],
            rotation: none,
            scale: [1.0; 3],
            scale_orientation: none,
        }
    }
}

impl Transform {
    /// From the children's coordinates to the parent's: T · C · R · SR · S · SR⁻¹ · C⁻¹.
    pub(super) fn matrix(&self) -> DAffine3 {
        let turn = rotation(self.scale_orientation);
        let scale = turn * DMat3::from_diagonal(self.scale.into()) * turn.transpose();
        let linear = rotation(self.rotation) * scale;
        let center = DVec3::from(self.center);
        let moved = center - linear * center;
        DAffine3::from_mat3_translation(linear, DVec3::from(self.translation) + moved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_turn_right_handed() {
        let half_pi = std::f64::consts::FRAC_PI_2;
        for (axis, from, to) in [
            ([0.0, 0.0, 2.0], DVec3::X, DVec3::Y),
            ([5.0, 0.0, 0.0], DVec3::Y, DVec3::Z),
            ([0.0, 1e-3, 0.0], DVec3::Z, DVec3::X),
        ] {
            let turned = rotation([axis[0], axis[1], axis[2], half_pi]) * from;
            assert!((turned - to).length() < 1e-15, "{turned}");
        }
        assert_eq!(rotation([0.0, 0.0, 0.0, 1.0]), DMat3::IDENTITY);
        let around = rotation([1.0, 2.0, -3.0, 1.234]);
        assert!((around * around.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-15));
        assert!((around.determinant() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn fields_of_a_transform_act_in_their_order() {
        let quarter = [0.0, 0.0, 1.0, std::f64::consts::FRAC_PI_2];
        let at = |t: Transform, p: [f64; 3]| t.matrix().transform_point3(p.into());
        let close = |a: DVec3, b: [f64; 3]| assert!((a - DVec3::from(b)).length() < 1e-14, "{a}");
        close(
            at(Transform { translation: [1.0, 2.0, 3.0], ..Transform::default() }, [0.0; 3]),
            [1.0, 2.0, 3.0],
        );
        // About (1, 0, 0) the point (2, 0, 0) goes to (1, 1, 0); scaled by 3 beforehand, to (1, 3, 0).
        let turned = Transform { center: [1.0, 0.0, 0.0], rotation: quarter, ..Transform::default() };
        close(at(turned, [2.0, 0.0, 0.0]), [1.0, 1.0, 0.0]);
        close(at(Transform { scale: [3.0, 1.0, 1.0], ..turned }, [2.0, 0.0, 0.0]), [1.0, 3.0, 0.0]);
        // Scaling by 5 along the x axis turned by 90 degrees is scaling along y.
        let along_y =
            Transform { scale: [5.0, 1.0, 1.0], scale_orientation: quarter, ..Transform::default() };
        close(at(along_y, [1.0, 1.0, 1.0]), [1.0, 5.0, 1.0]);
    }
}
