//! Winding numbers of triangles in memory at any points, without an octree.

use crate::build::is_closed;
use crate::ingest::{Facets, Input};
use crate::lattice::RootCube;
use crate::winding::{OpenPart, open_winding_at, winding_at};
use crate::{Error, Progress, Result, Silent};

/// Largest error where triangles do not close.
const ERROR: f64 = 1e-6;

/// The generalized winding number of triangles, at any points: exact where they close, otherwise within 10⁻⁶.
///
/// ```
/// # fn main() -> brickfield_engine::Result<()> {
/// use brickfield_engine::Field;
/// let vertices = vec![[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
/// let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
/// let field = Field::new(vertices, triangles)?;
/// assert_eq!(field.at(&[[1.0, 1.0, 1.0], [9.0, 9.0, 9.0]])?, [1.0, 0.0]);
/// # Ok(())
/// # }
/// ```
pub struct Field {
    input: Input,
    root: RootCube,
    /// The caps of the holes, of triangles that do not close.
    open: Option<OpenPart>,
}

impl Field {
    /// Of triangles, which name their corners among `vertices`, counter-clockwise seen from outside.
    ///
    /// # Errors
    /// Triangles that name a vertex that is not there; none at all; coordinates that are no numbers, or fit no lattice.
    pub fn new(vertices: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Result<Field> {
        let input = Input::of_triangles("(memory)", vertices, triangles)?;
        let (low, high) = input.bounds(&Silent)?;
        let root = RootCube::around(low, high).ok_or_else(|| {
            Error::setting(
                format!("the triangles span {low:?} to {high:?}, which fits no lattice"),
                "give them an extent",
            )
        })?;
        let sources = [&input as &dyn Facets];
        let open = if is_closed(&sources, root, &Silent)? {
            None
        } else {
            Some(OpenPart::of(&sources, root, &Silent)?)
        };
        Ok(Field { input, root, open })
    }

    /// w at points in the unit of the vertices.
    ///
    /// # Errors
    /// What the sums give for points that are no numbers.
    pub fn at(&self, points: &[[f64; 3]]) -> Result<Vec<f64>> {
        self.at_with(points, &Silent)
    }

    /// As [`Self::at`], with progress.
    ///
    /// # Errors
    /// As [`Self::at`]; [`Error::Interrupted`].
    pub fn at_with(&self, points: &[[f64; 3]], progress: &dyn Progress) -> Result<Vec<f64>> {
        let sources = [&self.input as &dyn Facets];
        match &self.open {
            None => {
                Ok(winding_at(&sources, self.root, points, progress)?.into_iter().map(|w| w as f64).collect())
            }
            Some(open) => open_winding_at(&sources, self.root, open, points, ERROR, progress),
        }
    }
}
