//! An arc tangent from additions, multiplications and one division: the same bits on every machine.

use std::f64::consts::{FRAC_PI_2, PI};

/// Tangents of the angles from which the polynomial measures the rest: 0, 1/4, 1/2, 3/4, 1; and the angles.
const STEPS: [f64; 5] = [
    0.0,
    0.244_978_663_126_864_15,
    0.463_647_609_000_806_1,
    0.643_501_108_793_284_4,
    std::f64::consts::FRAC_PI_4,
];

/// The angle of the vector (x, y) for y ≥ 0, in 0..=π; 0 for the zero vector. The error is below 4e-16.
///
/// With t = y/x in 0..=1 and c the nearest quarter, atan t = atan c + atan z with z = (t − c)/(1 + tc),
/// |z| ≤ 1/8, and the Taylor series of atan z to z^17 leaves less than z^19/19 < 4e-19.
///
/// Nothing branches, so that a loop over this becomes vector instructions.
#[inline(always)]
pub fn angle_of(y: f64, x: f64) -> f64 {
    debug_assert!(y >= 0.0 || y.is_nan());
    let ax = x.abs();
    let (small, large) = if y <= ax { (y, ax) } else { (ax, y) };
    let mut c = 0.0;
    let mut base = STEPS[0];
    for (step, eighths) in (1..).zip([1.0, 3.0, 5.0, 7.0]) {
        let beyond = 8.0 * small >= eighths * large;
        c = if beyond { 0.25 * f64::from(step) } else { c };
        base = if beyond { STEPS[step as usize] } else { base };
    }
    let z = (small - c * large) / (large + c * small);
    let s = z * z;
    let series = 1.0 / 13.0 + s * (-1.0 / 15.0 + s * (1.0 / 17.0));
    let series = -1.0 / 7.0 + s * (1.0 / 9.0 + s * (-1.0 / 11.0 + s * series));
    let first = base + (z + z * (s * (-1.0 / 3.0 + s * (1.0 / 5.0 + s * series))));
    let quarter = if y <= ax { first } else { FRAC_PI_2 - first };
    let angle = if x < 0.0 { PI - quarter } else { quarter };
    if large == 0.0 { 0.0 } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn agrees_with_the_platform(y in 0.0f64..2.0, x in -2.0f64..2.0, scale in -300i32..300) {
            let k = 2f64.powi(scale);
            let difference = angle_of(y * k, x * k) - (y * k).atan2(x * k);
            prop_assert!(difference.abs() <= 9e-16, "{}", difference);
        }
    }

    #[test]
    fn the_axes_and_the_borders_of_the_steps() {
        assert_eq!(angle_of(0.0, 0.0), 0.0);
        assert_eq!(angle_of(0.0, 3.0), 0.0);
        assert_eq!(angle_of(0.0, -3.0), PI);
        assert_eq!(angle_of(3.0, 0.0), FRAC_PI_2);
        for eighths in 0..=8 {
            let t = f64::from(eighths) / 8.0;
            for t in [t, t * (1.0 - f64::EPSILON), t * (1.0 + f64::EPSILON)] {
                assert!((angle_of(t, 1.0) - t.atan()).abs() <= 4e-16, "{t}");
            }
        }
    }
}
