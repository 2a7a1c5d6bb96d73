//! Cells and samples about a leaf, counted from its first one, so that those below it are negative.

/// A cell or sample.
pub(super) type LocalIndex = [i32; 3];

/// A direction to a neighbour across a face, 2·axis + side.
pub(super) type Direction = u8;

/// The neighbour of a cell in a direction.
pub(super) fn neighbour(mut cell: LocalIndex, direction: Direction) -> LocalIndex {
    cell[usize::from(direction / 2)] += 2 * i32::from(direction % 2) - 1;
    cell
}

/// The cell that holds a point.
pub(super) fn home_of(point: [f64; 3]) -> LocalIndex {
    point.map(|c| c.floor() as i32)
}

/// Whether two cells are one or have a corner in common.
pub(super) fn is_next_to(a: LocalIndex, b: LocalIndex) -> bool {
    (0..3).all(|n| (a[n] - b[n]).abs() <= 1)
}
