//! Where the lattice lies under an input, and how deep its tree is.

use super::options::Resolution;
use crate::error::{Error, Result};
use crate::lattice::{MAX_LEVEL, RootCube};
use std::path::Path;

/// [`Resolution::Auto`] of all but point clouds.
pub(super) const AUTO_DEPTH: u8 = 4;

/// The root cube and the deepest level.
pub(super) fn place(
    first: Option<&Path>,
    min: [f64; 3],
    max: [f64; 3],
    resolution: Resolution,
) -> Result<(RootCube, u8)> {
    place_by(first, (min, max), resolution, |resolution| match resolution {
        Resolution::Auto => RootCube::around(min, max).map(|root| (root, AUTO_DEPTH)),
        Resolution::Depth(depth) => RootCube::around(min, max).map(|root| (root, depth)),
        Resolution::Cell(cell) => RootCube::with_cell(min, max, cell),
        Resolution::Like(root, depth) => Some((root, depth)),
    })
}

/// What `by` makes of a resolution that fits the lattice.
///
/// # Errors
/// If the resolution does not fit it, or `by` finds no cube.
pub(super) fn place_by(
    first: Option<&Path>,
    (min, max): ([f64; 3], [f64; 3]),
    resolution: Resolution,
    by: impl FnOnce(Resolution) -> Option<(RootCube, u8)>,
) -> Result<(RootCube, u8)> {
    if let Resolution::Cell(cell) = resolution {
        let extent = (0..3).map(|a| max[a] - min[a]).fold(0.0, f64::max);
        let finest = extent / 32.0 / f64::from(1u32 << MAX_LEVEL);
        if !(cell > finest && cell.is_finite()) {
            return Err(Error::setting(
                format!("a cell of {cell} is too small for a part of {extent}"),
                format!("use a cell of at least {:.3e}", finest * 1.1),
            ));
        }
    }
    if let Resolution::Like(root, depth) = resolution {
        // Samples on the root's own faces must lie outside the input.
        let margin = root.spacing(depth) / 4.0;
        let far = root.origin.map(|c| c + root.edge);
        let fits = |a: usize| min[a] >= root.origin[a] + margin && max[a] <= far[a] - margin;
        if !(0..3).all(fits) {
            return Err(Error::setting(
                format!(
                    "the input spans {min:?} to {max:?}, and the lattice of `like` {:?} to {far:?}",
                    root.origin
                ),
                "build the larger part first, and the other one like it",
            ));
        }
    }
    by(resolution).ok_or_else(|| {
        let (place, what) = ("bounds", format!("the input spans {min:?} to {max:?}, which fits no lattice"));
        let remedy =
            "it must have an extent, and lie no farther than some millions of its size from the origin";
        match first {
            Some(path) => Error::input(path, place, what, remedy),
            None => Error::setting("there is no input", "give at least one mesh"),
        }
    })
}
