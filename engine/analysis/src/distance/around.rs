//! The normal of the surface around a place, from all crossings that are near.
//!
//! Normals of crossings are those of the facets that they lie on. Where the input has facets smaller than cells, positions tell
//! the normal of what the facets stand for better.

use crate::lattice::{dot, frame, minus};

/// How far crossings tell of the surface around a place, in cells, and how alike their normals must be.
pub(super) const AROUND: f64 = 2.0;
const ALIKE: f64 = 0.9;
/// Up to this size of both curvatures, in reciprocal cells, a quadratic form is the surface as far as that.
const SLIGHT: f64 = 0.3;
/// Where normals differ by less than this, after what the surface bends between them, they are those of a smooth surface, and
/// the one at the place is right.
const EXACT: f64 = 0.004;
const THIRD: f64 = 0.4;
/// Unknowns of a quadratic form: height, two slopes, three second derivatives.
const UNKNOWNS: usize = 6;
/// Fewer crossings do not settle them.
const FEW: usize = 9;
/// There are seldom more.
const MANY: usize = 40;

type Equations = [[f64; UNKNOWNS + 1]; UNKNOWNS];

/// Sums over crossings about a place.
pub(super) struct Around {
    at: [f64; 3],
    normal: [f64; 3],
    across: [[f64; 3]; 2],
    /// Weights, squares of what normals differ by, and bends, each times its weight.
    sums: [f64; 3],
    /// Crossings that count, by their way from the place, with their weights.
    counted: Vec<([f64; 3], f64)>,
}

impl Around {
    pub fn new(at: [f64; 3], normal: [f64; 3]) -> Around {
        Around { at, normal, across: frame(normal), sums: [0.0; 3], counted: Vec::with_capacity(MANY) }
    }

    /// Whether a crossing may tell of the place.
    pub fn is_near(&self, crossing: [f64; 3]) -> bool {
        let away = minus(crossing, self.at);
        dot(away, away) < AROUND * AROUND
    }

    /// Adds a crossing, with the normal that its patch has at the place, and the size of its curvatures.
    pub fn add(&mut self, crossing: [f64; 3], turned: [f64; 3], bend: f64) {
        let away = minus(crossing, self.at);
        let share = 1.0 - dot(away, away) / (AROUND * AROUND);
        if share <= 0.0 || dot(turned, self.normal) < ALIKE {
            return;
        }
        let weight = share * share;
        let differs = minus(turned, self.normal);
        for (sum, term) in self.sums.iter_mut().zip([weight, weight * dot(differs, differs), weight * bend]) {
            *sum += weight * term;
        }
        self.counted.push((away, weight));
    }

    /// The unit normal.
    pub fn normal(self) -> [f64; 3] {
        let [u, v] = self.across;
        let [weights, differs, bend] = self.sums;
        let bend = bend / weights.max(f64::MIN_POSITIVE);
        // Normals of a bent surface differ by terms of third order, too.
        let exact = EXACT + THIRD * bend * bend * bend;
        let is_exact = differs <= exact * exact * weights || bend > SLIGHT;
        let slopes = if is_exact || self.counted.len() < FEW { None } else { self.solved() };
        let Some([p, q]) = slopes else { return self.normal };
        let turned: [f64; 3] = std::array::from_fn(|a| self.normal[a] - p * u[a] - q * v[a]);
        let length = dot(turned, turned).sqrt();
        turned.map(|c| c / length)
    }

    /// The upper half of the normal equations, which smooth surfaces do not need.
    fn equations(&self) -> Equations {
        let mut equations = [[0.0; UNKNOWNS + 1]; UNKNOWNS];
        for &(away, weight) in &self.counted {
            let [x, y] = self.across.map(|axis| dot(away, axis));
            let row = [1.0, x, y, 0.5 * x * x, x * y, 0.5 * y * y, dot(away, self.normal)];
            for n in 0..UNKNOWNS {
                (n..=UNKNOWNS).for_each(|m| equations[n][m] += weight * row[n] * row[m]);
            }
        }
        equations
    }

    /// Both slopes at the place, by elimination; `None` where crossings leave them open.
    fn solved(&self) -> Option<[f64; 2]> {
        let mut rows = self.equations();
        // The half that was summed, mirrored.
        let upper = rows;
        for (n, row) in rows.iter_mut().enumerate() {
            row.iter_mut().zip(&upper).take(n).for_each(|(term, other)| *term = other[n]);
        }
        let trace: f64 = (0..UNKNOWNS).map(|n| rows[n][n]).sum();
        // Slopes come last, so that nothing has to be put back.
        let order = [0, 3, 4, 5, 1, 2];
        for (step, &n) in order.iter().enumerate() {
            let pivot = rows[n][n];
            if pivot.is_nan() || pivot < 1e-5 * trace {
                return None;
            }
            for &m in &order[step + 1..] {
                let factor = rows[m][n] / pivot;
                let pivots = rows[n];
                rows[m].iter_mut().zip(pivots).for_each(|(term, pivot)| *term -= factor * pivot);
            }
        }
        let q = rows[2][UNKNOWNS] / rows[2][2];
        let p = (rows[1][UNKNOWNS] - rows[1][2] * q) / rows[1][1];
        // A steep slope is that of another surface.
        (p.hypot(q) < 0.3).then_some([p, q])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_tell_the_slope_where_normals_are_those_of_facets() {
        let mut around = Around::new([1.0, 2.0, 3.0], [0.0, 0.0, 1.0]);
        let [u, v] = frame([0.0, 0.0, 1.0]);
        for n in 0..25 {
            let (x, y) = (0.4 * f64::from(n % 5) - 0.75, 0.4 * f64::from(n / 5) - 0.83);
            let z = 0.02 * x - 0.01 * y + 0.05 * x * x - 0.03 * x * y;
            let at = std::array::from_fn(|a| [1.0, 2.0, 3.0][a] + x * u[a] + y * v[a] + [0.0, 0.0, z][a]);
            // Facets turn normals to all sides.
            let turn = 0.01 * f64::from(n % 3 - 1);
            around.add(at, [turn.sin(), 0.0, turn.cos()], 0.1);
        }
        let normal = around.normal();
        let slopes = [-dot(normal, u) / normal[2], -dot(normal, v) / normal[2]];
        assert!((slopes[0] - 0.02).abs() < 1e-9 && (slopes[1] + 0.01).abs() < 1e-9, "{slopes:?}");
    }

    #[test]
    fn normals_that_agree_are_taken() {
        let mut around = Around::new([0.0; 3], [0.0, 0.0, 1.0]);
        for n in 0..25 {
            let (x, y) = (0.4 * f64::from(n % 5) - 0.8, 0.4 * f64::from(n / 5) - 0.8);
            around.add([x, y, 0.1 * x], [0.0, 0.0, 1.0], 0.1);
        }
        assert_eq!(around.normal(), [0.0, 0.0, 1.0]);
    }
}
