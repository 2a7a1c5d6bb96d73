//! The smallest ball around points.

use crate::lattice::{dot, minus};

/// The radius of the smallest ball around some points (Welzl 1991; points outside move to the front, Gärtner 1999).
pub(super) fn smallest_ball(points: &[[f64; 3]]) -> f64 {
    let mut points = points.to_vec();
    let count = points.len();
    ball_around(&mut points, count, &mut Vec::new()).map_or(0.0, |(_, squared)| squared.sqrt())
}

/// The smallest ball around the first so many points that has those of `on` on its surface: its centre and the square of its
/// radius; `None` of no points.
fn ball_around(points: &mut [[f64; 3]], count: usize, on: &mut Vec<[f64; 3]>) -> Option<([f64; 3], f64)> {
    /// Of the squared radius, for rounding.
    const NEAR: f64 = 1e-12;
    let mut ball = ball_through(on);
    if on.len() == 4 {
        return ball;
    }
    for n in 0..count {
        let point = points[n];
        let is_outside = ball.is_none_or(|(centre, squared)| {
            let away = minus(point, centre);
            dot(away, away) > squared * (1.0 + NEAR)
        });
        if !is_outside {
            continue;
        }
        on.push(point);
        // Points that rounding takes for a plane's or a line's have no ball through them; the one at hand is around them.
        if ball_through(on).is_some() {
            ball = ball_around(points, n, on);
            points[..=n].rotate_right(1);
        }
        on.pop();
    }
    ball
}

/// The ball with up to four points on its surface and its centre among them: in their plane, on their line.
fn ball_through(on: &[[f64; 3]]) -> Option<([f64; 3], f64)> {
    /// Of the product of the squares of edges: flatter ones have no ball.
    const FLAT: f64 = 1e-20;
    let (first, others) = on.split_first()?;
    let edges: Vec<[f64; 3]> = others.iter().map(|p| minus(*p, *first)).collect();
    // The centre is `first` and a sum of edges; its product with each edge is half of that edge's square.
    let mut rows = [[0.0; 4]; 3];
    for (row, edge) in rows.iter_mut().zip(&edges) {
        edges.iter().enumerate().for_each(|(n, other)| row[n] = dot(*edge, *other));
        row[3] = 0.5 * dot(*edge, *edge);
    }
    let scale: f64 = edges.iter().map(|edge| dot(*edge, *edge)).product();
    let mut determinant = 1.0;
    for n in 0..edges.len() {
        determinant *= rows[n][n];
        if rows[n][n] <= 0.0 || determinant <= FLAT * scale {
            return None;
        }
        for m in (0..edges.len()).filter(|&m| m != n) {
            let share = rows[m][n] / rows[n][n];
            (0..4).for_each(|c| rows[m][c] -= share * rows[n][c]);
        }
    }
    let mut towards = [0.0; 3];
    for (n, edge) in edges.iter().enumerate() {
        let share = rows[n][3] / rows[n][n];
        towards = [0, 1, 2].map(|a| towards[a] + share * edge[a]);
    }
    Some(([0, 1, 2].map(|a| first[a] + towards[a]), dot(towards, towards)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn holds_all(ball: Option<([f64; 3], f64)>, points: &[[f64; 3]]) -> Option<f64> {
        let (centre, squared) = ball?;
        let away = |p: &[f64; 3]| dot(minus(*p, centre), minus(*p, centre));
        points.iter().all(|p| away(p) <= squared * (1.0 + 1e-9)).then(|| squared.sqrt())
    }

    /// The smallest of all balls through up to four points that hold the others.
    fn by_trying_all(points: &[[f64; 3]]) -> f64 {
        let mut least = f64::INFINITY;
        for subset in 1u32..1 << points.len() {
            if subset.count_ones() <= 4 {
                let on: Vec<_> =
                    (0..points.len()).filter(|n| subset >> n & 1 == 1).map(|n| points[n]).collect();
                least = holds_all(ball_through(&on), points).map_or(least, |radius| least.min(radius));
            }
        }
        least
    }

    #[test]
    fn balls_around_few_points() {
        assert_eq!(smallest_ball(&[]), 0.0);
        assert_eq!(smallest_ball(&[[1.0, 2.0, 3.0]; 3]), 0.0);
        assert_eq!(smallest_ball(&[[0.0; 3], [2.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), 1.0);
        let corners: Vec<[f64; 3]> = (0..8).map(|n| [0, 1, 2].map(|a| f64::from(n >> a & 1))).collect();
        assert!((smallest_ball(&corners) - 0.75f64.sqrt()).abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn no_ball_through_four_points_is_smaller(
            points in prop::collection::vec(prop::array::uniform3(-4i32..5), 1..9), scale in 1u32..1000
        ) {
            let points: Vec<[f64; 3]> = points.iter().map(|p| p.map(|c| f64::from(c) / f64::from(scale))).collect();
            let (found, expected) = (smallest_ball(&points), by_trying_all(&points));
            prop_assert!((found - expected).abs() <= 1e-9 * expected, "{} {}", found, expected);
        }
    }
}
