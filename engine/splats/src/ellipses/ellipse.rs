//! Flat ellipses, and which are wanted.

/// What ellipses are wanted.
#[derive(Clone, Copy, Debug)]
pub struct EllipseOptions {
    /// How many, at most.
    pub number: u32,
    /// Whether both radii of an ellipse are the same.
    pub circles: bool,
    /// Bytes that crossings and sites may take.
    pub memory: u64,
}

/// A flat ellipse, in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipse {
    /// Its middle.
    pub centre: [f64; 3],
    /// Unit normal, outward.
    pub normal: [f64; 3],
    /// Unit vectors along the two radii; with the normal they turn as x, y and z do.
    pub axes: [[f64; 3]; 2],
    /// Half its length along each.
    pub radii: [f64; 2],
    /// Greatest distance of a crossing in it from its plane.
    pub error: f64,
}
