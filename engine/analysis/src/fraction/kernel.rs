//! The tent by which solid is averaged, and how far a plane is from a sample whose fraction is known.

/// Coarse samples before the tree's first one: the tent reaches one beyond it, and samples at the root's faces are outside.
pub(super) const BEFORE: i64 = 2;

/// The largest whole number that is no larger, where it fits. Without the wide vectors of today `f64::floor` is a call.
#[inline]
pub(super) fn floor(at: f64) -> i64 {
    let cut = at as i64;
    cut - i64::from(at < cut as f64)
}

/// What an interval that begins at `at`, in coarse cells, and never ends adds to the samples around: the number of the first
/// sample, and by how much its value and those of the next two rise above the one before. Sums of all rises up to a sample
/// are its value: the integral of the tent of half-width 1 about it.
#[inline]
pub(super) fn rises(at: f64) -> (i64, [f64; 3]) {
    let first = floor(at);
    let u = at - first as f64;
    (first, [0.5 * (1.0 - u) * (1.0 - u), 0.5 + u - u * u, 0.5 * u * u])
}

/// The tent at a position in coarse cells: the first sample that it reaches, and its weights there and at the next.
#[inline]
pub(super) fn tent(at: f64) -> (i64, [f64; 2]) {
    let first = floor(at);
    let u = at - first as f64;
    (first, [1.0 - u, u])
}

/// The distance, in coarse cells, of a plane along an axis from a sample with this fraction of solid: −1 where there is none,
/// 1 where there is nothing else. So planes along the axes come back exactly where they were; those across them nearly.
#[inline]
pub(super) fn depth(fraction: f64) -> f64 {
    if fraction <= 0.5 {
        (2.0 * fraction.max(0.0)).sqrt() - 1.0
    } else {
        1.0 - (2.0 * (1.0 - fraction).max(0.0)).sqrt()
    }
}

/// The inverse of [`depth`].
#[inline]
pub(super) fn fraction_at(depth: f64) -> f64 {
    let depth = depth.clamp(-1.0, 1.0);
    if depth <= 0.0 { 0.5 * (1.0 + depth) * (1.0 + depth) } else { 1.0 - 0.5 * (1.0 - depth) * (1.0 - depth) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rises_are_integrals_of_the_tent() {
        for at in [-1.75, 0.0, 0.3, 2.5, 6.999] {
            let (first, rises) = rises(at);
            // By the rectangle rule, about each sample near.
            let mut value = 0.0;
            for sample in first - 1..first + 4 {
                value += usize::try_from(sample - first).ok().and_then(|n| rises.get(n)).unwrap_or(&0.0);
                let steps = 20_000;
                let integral: f64 = (0..steps)
                    .map(|n| -1.0 + 2.0 * (f64::from(n) + 0.5) / f64::from(steps))
                    .filter(|x| sample as f64 + x >= at)
                    .map(|x: f64| (1.0 - x.abs()) * 2.0 / f64::from(steps))
                    .sum();
                assert!((value - integral).abs() < 2e-4, "{at} {sample}: {value} {integral}");
            }
        }
    }

    #[test]
    fn planes_come_back_where_they_were() {
        for n in 0..=40 {
            let distance = f64::from(n) / 20.0 - 1.0;
            // Solid is all below a plane that lies so far above the sample.
            let (first, rises) = rises(-distance);
            let value: f64 = (first..=0).map(|s| rises.get((s - first) as usize).unwrap_or(&0.0)).sum();
            assert!((depth(value) - distance).abs() < 1e-7, "{distance} {value}");
            assert!((depth(fraction_at(distance)) - distance).abs() < 1e-7);
        }
    }
}
