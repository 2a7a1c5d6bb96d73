//! Functions of w given at some values of it, straight in between.

use crate::error::{Error, Result};

/// Winding numbers up to which stops, and surfaces, may lie.
pub const W_MAX: f64 = 32_767.0;

/// A function of w: what it is at rising values of w. Between two of them it is interpolated, before the first and after
/// the last it stays.
#[derive(Clone, Debug, PartialEq)]
pub struct Stops<const N: usize>(Vec<(f64, [f64; N])>);

impl<const N: usize> Stops<N> {
    /// Takes pairs of w and what the function is there.
    ///
    /// # Errors
    /// [`Error::Setting`] if there are none, or more than 256, or w does not rise from each to the next or is beyond
    /// [`W_MAX`].
    pub fn new(stops: Vec<(f64, [f64; N])>) -> Result<Stops<N>> {
        let refused = |what: String| Err(Error::setting(what, "give 1 to 256 stops, the smallest w first"));
        if !(1..=256).contains(&stops.len()) {
            return refused(format!("{} stops make no transfer function", stops.len()));
        }
        if let Some((w, _)) = stops.iter().find(|(w, _)| !(-W_MAX..=W_MAX).contains(w)) {
            return refused(format!("no winding number is {w}"));
        }
        if let Some(pair) = stops.windows(2).find(|pair| pair[0].0 >= pair[1].0) {
            return refused(format!("the stop at w = {} follows that at {}", pair[1].0, pair[0].0));
        }
        Ok(Stops(stops))
    }

    /// Its first and its last w.
    pub fn range(&self) -> [f64; 2] {
        [self.0[0].0, self.0[self.0.len() - 1].0]
    }

    /// The function at `w`.
    pub fn at(&self, w: f64) -> [f64; N] {
        let after = self.0.partition_point(|(stop, _)| *stop <= w);
        let (before, after) = (after.saturating_sub(1), after.min(self.0.len() - 1));
        let ((low, a), (high, b)) = (self.0[before], self.0[after]);
        if before == after {
            return a;
        }
        let part = ((w - low) / (high - low)).max(0.0);
        std::array::from_fn(|n| a[n] + (b[n] - a[n]) * part)
    }

    /// The stops.
    pub(super) fn iter(&self) -> impl Iterator<Item = &(f64, [f64; N])> {
        self.0.iter()
    }

    /// The values at the stops.
    pub(super) fn values(&self) -> impl Iterator<Item = [f64; N]> {
        self.0.iter().map(|(_, value)| *value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_between_stops_and_level_beyond() {
        let stops = Stops::new(vec![(-1.0, [0.0, 5.0]), (1.0, [1.0, 5.0]), (1.5, [0.0, 6.0])]).unwrap();
        for (w, expected) in [
            (-9.0, [0.0, 5.0]),
            (-1.0, [0.0, 5.0]),
            (0.0, [0.5, 5.0]),
            (1.0, [1.0, 5.0]),
            (1.25, [0.5, 5.5]),
            (1.5, [0.0, 6.0]),
            (99.0, [0.0, 6.0]),
        ] {
            assert_eq!(stops.at(w), expected, "{w}");
        }
        assert_eq!(stops.range(), [-1.0, 1.5]);
        assert_eq!(Stops::new(vec![(2.0, [7.0])]).unwrap().at(0.0), [7.0]);
    }

    #[test]
    fn what_is_no_function_is_refused() {
        for bad in [vec![], vec![1.0, 1.0], vec![2.0, 1.0], vec![f64::NAN], vec![1e9], vec![0.0; 257]] {
            let error = Stops::new(bad.iter().map(|w| (*w, [0.0])).collect()).unwrap_err().to_string();
            assert!(!error.contains('\n') && error.contains("stop"), "{error}");
        }
    }
}
