//! What is found of the surface: its patches by number, nearest points, places where balls touch.

/// Which patch: its leaf among those with surface, and its number there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Place {
    /// Number of the leaf.
    pub leaf: u32,
    /// Number of the patch.
    pub patch: u32,
}

/// A point of the surface. Lengths are in cells of the deepest level, places counted from the root's first sample.
#[derive(Clone, Copy, Debug)]
pub struct Foot {
    /// Where it is.
    pub at: [f64; 3],
    /// The unit normal there, outward.
    pub normal: [f64; 3],
    /// How far it is from what was asked about.
    pub distance: f64,
    /// Whether what was asked about lies on the inner side.
    pub inside: bool,
    /// Its patch.
    pub place: Place,
}

/// Where a ball touches the surface.
#[derive(Clone, Copy, Debug)]
pub struct BallAt {
    /// The place, in cells.
    pub at: [f64; 3],
    /// Unit vector from there to the ball's centre.
    pub toward: [f64; 3],
    /// The outward unit normal of the surface there.
    pub outward: [f64; 3],
}

/// A point of a reference, in world units.
#[derive(Clone, Copy, Debug)]
pub struct ReferencePoint {
    /// Where it is.
    pub at: [f64; 3],
    /// The unit normal there.
    pub normal: [f64; 3],
    /// How far it is, below 0 from within; not a number where a cloud tells nothing.
    pub signed: f64,
}
