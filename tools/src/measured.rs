//! Numbers with what they may be off by, in the digits that they deserve.

/// A value with its error, as in "314.16 ± 0.03": the error rounded up to one digit, or two where the first is a 1, and the
/// value to the same place. An error of 0, or less than doubles tell, leaves six digits after the point.
pub fn measured(value: f64, error: f64) -> String {
    const MOST_DIGITS: i32 = 9;
    if !value.is_finite() || !error.is_finite() {
        return format!("{value} ± {error}");
    }
    let error = error.abs();
    if error < 1e-9 * value.abs() || error == 0.0 {
        return format!("{value:.6}");
    }
    let mut place = error.log10().floor() as i32;
    // Two digits tell 0.11 from 0.2.
    if error / 10f64.powi(place) < 2.0 {
        place -= 1;
    }
    let digits = (-place).clamp(-MOST_DIGITS, MOST_DIGITS);
    let step = 10f64.powi(-digits);
    let rounded = ((value / step).round() * step, ((error / step) - 1e-9).ceil() * step);
    let after = digits.max(0) as usize;
    format!("{:.after$} ± {:.after$}", rounded.0, rounded.1)
}

#[cfg(test)]
mod tests {
    use super::measured;

    #[test]
    fn values_have_the_digits_that_their_errors_leave() {
        for (value, error, text) in [
            (314.159_265, 0.027, "314.16 ± 0.03"),
            (314.159_265, 0.012_4, "314.159 ± 0.013"),
            (314.159_265, 0.19, "314.16 ± 0.19"),
            (1_234_567.0, 2_345.0, "1235000 ± 3000"),
            (0.0, 0.5, "0.0 ± 0.5"),
            (-2.5, 0.1, "-2.50 ± 0.10"),
            (80.0, 0.0, "80.000000"),
            (80.0, 1e-12, "80.000000"),
        ] {
            assert_eq!(measured(value, error), text);
        }
    }
}
