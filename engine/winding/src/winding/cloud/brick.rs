//! Bricks of point clouds.

use super::super::open::{OpenBrick, Shares, binary_places, fixed_point, least_bits};
use super::cells::CloudCells;
use super::near::NearPoints;
use super::roots::hermite_of;
use super::{CloudField, Surfels};
use crate::brick::{Brick, POINTS, Samples};
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey, RootCube, Units};

/// Cells across a ball's radius below which samples may miss what it holds.
const CELLS_TO_SEE: i64 = 2;

/// Fewest binary places of samples: normals of the surface come from their differences.
const BITS_MIN: u8 = 10;

/// The least error that sums in 32 bits keep.
const SINGLE_ERROR: f64 = 1e-2;

/// The field of a cloud as bricks see it.
#[derive(Debug)]
pub struct CloudBricks {
    field: CloudField,
    /// Of sums in 32 bits.
    cells: CloudCells,
    /// Whether the error allows these in samples; where the surface passes between samples they do.
    is_single: bool,
    bits: u8,
    error: f64,
    least: u32,
}

/// A point of a cloud as the octree sees it: the ball over which it is spread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CloudPiece {
    /// Where it is; even.
    pub position: Units,
    /// At least its radius; even.
    pub radius: i32,
}

/// Working memory; one per thread.
#[derive(Default)]
pub struct CloudEvaluator {
    shares: Shares,
    near: NearPoints,
    values: Option<Box<[f64; POINTS]>>,
}

/// The samples of one brick.
pub struct CloudBrick<'a> {
    smooth: OpenBrick,
    has_details: bool,
    key: NodeKey,
    bricks: &'a CloudBricks,
    near: &'a mut NearPoints,
}

impl CloudBricks {
    /// With samples that are off by at most `error`, for a tree whose deepest bricks are of a level.
    ///
    /// # Errors
    /// [`crate::error::Error::Setting`] if samples of 16 bits cannot be that exact.
    /// If the temporary file for what memory has no room for cannot be written.
    pub fn new(surfels: Surfels, root: RootCube, error: f64, depth: u8) -> Result<CloudBricks> {
        let (bits, least) = (binary_places(error)?.max(BITS_MIN), least_bits(depth));
        let exact = error - 0.5 / f64::from(1u32 << bits);
        let field = CloudField::of_all(surfels, root)?;
        let is_single = error >= SINGLE_ERROR;
        let cells = CloudCells::new(&field.tree, if is_single { exact } else { SINGLE_ERROR }, depth)?;
        Ok(CloudBricks { field, cells, is_single, bits, error, least })
    }

    /// The numbers of all points.
    pub fn numbers(&self) -> Vec<u32> {
        (0..self.field.tree.elements().len() as u32).collect()
    }

    /// The ball of a point. Points with near numbers are near each other.
    pub fn piece(&self, number: u32) -> CloudPiece {
        let dipole = &self.field.tree.elements()[number as usize];
        // Reaches are below a few root edges, and the next even number is enough.
        CloudPiece { position: dipole.at(), radius: dipole.radius() as i32 / 2 * 2 + 2 }
    }

    /// The balls of all points.
    pub fn pieces(&self) -> impl Iterator<Item = CloudPiece> {
        (0..self.field.tree.elements().len() as u32).map(|number| self.piece(number))
    }

    /// Evaluates the 33³ samples of `key`, which the balls of `pieces` touch. A sample's value depends on its position
    /// and on nothing else. Samples on the root's own faces count as outside.
    ///
    /// # Errors
    /// [`crate::error::Error::Setting`] if a winding number does not fit 16 bits.
    pub fn evaluate<'a>(
        &'a self,
        scratch: &'a mut CloudEvaluator,
        key: NodeKey,
        mut pieces: impl Iterator<Item = CloudPiece>,
    ) -> Result<CloudBrick<'a>> {
        let samples = fixed_point(key, self.bits, self.sums(scratch, key).iter().copied())?;
        let has_details = pieces.any(|piece| !piece.is_seen_by(key));
        let smooth = OpenBrick::smooth(samples, key, self.error);
        Ok(CloudBrick { smooth, has_details, key, bricks: self, near: &mut scratch.near })
    }

    /// The sums over all dipoles at the samples of a brick: rounded to the binary places, they are off by at most the error.
    pub(in crate::winding) fn sums<'a>(
        &self,
        scratch: &'a mut CloudEvaluator,
        key: NodeKey,
    ) -> &'a [f64; POINTS] {
        let CloudEvaluator { shares, near, values } = scratch;
        if !self.is_single {
            shares.find(&self.field.tree, (self.error, self.bits, self.least), key);
            return shares.values();
        }
        let values = values.get_or_insert_with(|| Box::new([0.0; POINTS]));
        self.cells.fill(&self.field.tree, key, near, values);
        values
    }

    /// Binary places of all samples.
    pub(in crate::winding) fn binary_places(&self) -> u8 {
        self.bits
    }
}

impl CloudPiece {
    /// The box around the ball.
    pub fn bounds(&self) -> (Units, Units) {
        (self.position.map(|c| c - self.radius), self.position.map(|c| c + self.radius))
    }

    /// Whether the ball touches the closed cube `low..low + size`.
    pub fn touches_cube(&self, low: Units, size: i32) -> bool {
        let squared: i64 = (0..3)
            .map(|a| {
                let from = i64::from(self.position[a]) - i64::from(low[a]);
                let beyond = (-from).max(from - i64::from(size)).max(0);
                beyond * beyond
            })
            .sum();
        squared <= i64::from(self.radius) * i64::from(self.radius)
    }

    /// Whether the samples of a brick show what the field does over the ball.
    pub fn is_seen_by(&self, key: NodeKey) -> bool {
        i64::from(self.radius) >= CELLS_TO_SEE << key.spacing_bits()
    }
}

impl CloudBrick<'_> {
    /// The samples, with binary places.
    pub fn samples(&self) -> &Samples {
        &self.smooth.samples
    }

    /// The same, for good.
    pub fn into_samples(self) -> Samples {
        self.smooth.samples
    }

    /// Whether a ball touches the brick that is too small for its samples to show.
    pub fn has_details(&self) -> bool {
        self.has_details
    }

    /// As [`OpenBrick::is_straight`].
    pub fn is_straight(&self) -> bool {
        self.smooth.is_straight()
    }

    /// The leaf's brick with its Hermite edges: where the sum passes 0.5, with the normal −∇w.
    pub fn into_leaf(self) -> Brick {
        let CloudBrick { smooth, key, bricks, near, .. } = self;
        let hermite = hermite_of((&bricks.cells, &bricks.field.tree), key, &smooth.samples, near);
        smooth.into_leaf_with(hermite)
    }
}

const _: () = assert!(CELLS_TO_SEE < BRICK_CELLS as i64, "a brick sees balls of its own size");
