//! Small systems of equations.

/// The solution of the first `unknowns` of symmetric equations with a positive matrix, zeros after them; `None` if the
/// matrix is not positive.
///
/// Elimination without pivoting, in a fixed order, none of it fused: its bits are the same everywhere.
pub fn solved_positive<const N: usize>(
    mut matrix: [[f64; N]; N],
    mut rhs: [f64; N],
    unknowns: usize,
) -> Option<[f64; N]> {
    for n in 0..unknowns {
        let (pivot, row) = (matrix[n][n], matrix[n]);
        if pivot.is_nan() || pivot <= 0.0 {
            return None;
        }
        for m in n + 1..unknowns {
            let factor = matrix[m][n] / pivot;
            (n..N).for_each(|k| matrix[m][k] -= factor * row[k]);
            rhs[m] -= factor * rhs[n];
        }
    }
    let mut x = [0.0; N];
    for n in (0..unknowns).rev() {
        let known: f64 = (n + 1..unknowns).map(|m| matrix[n][m] * x[m]).sum();
        x[n] = (rhs[n] - known) / matrix[n][n];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_solution_satisfies_the_equations() {
        let matrix = [[4.0, 1.0, -1.0], [1.0, 3.0, 0.5], [-1.0, 0.5, 2.0]];
        let x = [1.0, -2.0, 0.25];
        let rhs = matrix.map(|row| (0..3).map(|n| row[n] * x[n]).sum());
        let found = solved_positive(matrix, rhs, 3).unwrap();
        assert!((0..3).all(|n| (found[n] - x[n]).abs() < 1e-14));
        let two = solved_positive(matrix, rhs, 2).unwrap();
        assert!((4.0 * two[0] + two[1] - rhs[0]).abs() < 1e-14 && two[2] == 0.0);
    }

    #[test]
    fn a_matrix_that_is_not_positive_has_no_solution() {
        assert_eq!(solved_positive([[1.0, 2.0], [2.0, 1.0]], [1.0; 2], 2), None);
        assert_eq!(solved_positive([[f64::NAN]], [1.0], 1), None);
    }
}
