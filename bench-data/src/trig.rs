//! Sine and cosine that give the same bits on every machine.
//!
//! The standard library hands these to the platform's libm, whose last bit differs from one to the next;
//! the recorded hashes of generated files must not.

use std::f64::consts::FRAC_2_PI;

/// π/2 in two parts: the first has 33 bits, so its product with a small integer is exact.
const HALF_PI_HIGH: f64 = 1.570_796_326_734_125_6;
const HALF_PI_LOW: f64 = 6.077_100_506_506_192e-11;

/// Sine and cosine of `angle` in radians, |angle| < 10⁶, to about 2⁻⁵¹.
pub fn sin_cos(angle: f64) -> (f64, f64) {
    let quarter = (angle * FRAC_2_PI + 0.5).floor();
    let r = (angle - quarter * HALF_PI_HIGH) - quarter * HALF_PI_LOW;
    let (s, c) = (taylor(r, r, 1.0), taylor(1.0, r, 0.0));
    match (quarter as i64).rem_euclid(4) {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

/// Σ (−1)ᵏ x^(2k+first)/(2k+first)! for |x| ≤ π/4, nine terms, as a Horner scheme; `lead` is the first term.
fn taylor(lead: f64, x: f64, first: f64) -> f64 {
    let mut sum = 1.0;
    for k in (1..9).rev() {
        let top = 2.0 * f64::from(k) + first;
        sum = 1.0 - sum * (x * x) / (top * (top - 1.0));
    }
    lead * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_libm() {
        for i in -4000..4000 {
            let angle = f64::from(i) * 0.037;
            let (s, c) = sin_cos(angle);
            assert!((s - angle.sin()).abs() < 1e-15, "{angle}: {s}");
            assert!((c - angle.cos()).abs() < 1e-15, "{angle}: {c}");
        }
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
    }
}
