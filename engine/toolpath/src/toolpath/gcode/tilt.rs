//! The axis of a tilting head.

/// Axis of a tool turned by `degrees` about X, Y and Z (the words A, B and C), in that order about fixed axes:
/// Rz(C)·Ry(B)·Rx(A)·z, a unit vector that points away from the part.
pub(crate) fn axis(degrees: [f64; 3]) -> [f64; 3] {
    let [(sin_a, cos_a), (sin_b, cos_b), (sin_c, cos_c)] = degrees.map(sine_and_cosine);
    let (x, y, z) = (cos_a * sin_b, -sin_a, cos_a * cos_b);
    [cos_c * x - sin_c * y, sin_c * x + cos_c * y, z]
}

/// Sine and cosine of an angle in degrees by their series, within 1e-15. No platform's library is asked, so
/// that the same file gives the same bits everywhere; multiples of 90 degrees are exact.
pub(crate) fn sine_and_cosine(degrees: f64) -> (f64, f64) {
    let turned = degrees % 360.0;
    let quarters = (turned / 90.0).round();
    let x = (turned - 90.0 * quarters) * (std::f64::consts::PI / 180.0);
    // |x| ≤ π/4: the 10th terms are below 1e-17.
    let square = x * x;
    let (mut sine, mut cosine) = (1.0, 1.0);
    for term in (1..=10).rev() {
        let n = 2.0 * f64::from(term);
        sine = 1.0 - square / (n * (n + 1.0)) * sine;
        cosine = 1.0 - square / ((n - 1.0) * n) * cosine;
    }
    let (sine, cosine) = (x * sine, cosine);
    match (quarters as i64).rem_euclid(4) {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_agree_with_the_library() {
        for step in -4000..4000 {
            let degrees = f64::from(step) * 0.37;
            let (sine, cosine) = sine_and_cosine(degrees);
            let radians = degrees.to_radians();
            assert!(
                (sine - radians.sin()).abs() < 1e-14 && (cosine - radians.cos()).abs() < 1e-14,
                "{degrees}"
            );
        }
        for (degrees, expected) in
            [(0.0, (0.0, 1.0)), (90.0, (1.0, 0.0)), (-90.0, (-1.0, 0.0)), (900.0, (0.0, -1.0))]
        {
            assert_eq!(sine_and_cosine(degrees), expected);
        }
    }

    #[test]
    fn each_word_turns_about_its_axis() {
        let close = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15);
        assert_eq!(axis([0.0; 3]), [0.0, 0.0, 1.0]);
        assert!(close(axis([90.0, 0.0, 0.0]), [0.0, -1.0, 0.0]));
        assert!(close(axis([0.0, 90.0, 0.0]), [1.0, 0.0, 0.0]));
        assert!(close(axis([0.0, 30.0, 90.0]), [0.0, 0.5, 0.75f64.sqrt()]));
        assert!(close(axis([30.0, 0.0, 180.0]), [0.0, 0.5, 0.75f64.sqrt()]));
    }
}
