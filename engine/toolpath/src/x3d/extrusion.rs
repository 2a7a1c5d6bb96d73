//! One Extrusion node, and what a reader hands over of a file.

use crate::error::Result;
use glam::DAffine3;

/// The geometry of one Extrusion node with the specification's defaults, checked: all numbers are finite, and
/// `scale` and `orientation` hold one value or at least one for each spine point.
#[derive(Clone, Debug, PartialEq)]
pub struct Extrusion {
    /// The outline in the plane of X and Z, in (x, z).
    pub cross_section: Vec<[f64; 2]>,
    /// Where the cross-section goes.
    pub spine: Vec<[f64; 3]>,
    /// Factors along X and Z, above zero.
    pub scale: Vec<[f64; 2]>,
    /// Rotations within the cross-section's planes: axis and angle in radians.
    pub orientation: Vec<[f64; 4]>,
    /// Whether the first end is closed.
    pub begin_cap: bool,
    /// Whether the last end is closed.
    pub end_cap: bool,
    /// False turns all triangles over.
    pub ccw: bool,
    /// The author's word that the cross-section is convex. Caps are right without it.
    pub convex: bool,
    /// Whether only the outside is meant to be seen.
    pub solid: bool,
    /// Its DEF name.
    pub def: Option<String>,
    /// Line of the file, from 1.
    pub line: u64,
}

impl Default for Extrusion {
    fn default() -> Extrusion {
        Extrusion {
            cross_section: vec![[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]],
            spine: vec![[0.0; 3], [0.0, 1.0, 0.0]],
            scale: vec![[1.0; 2]],
            orientation: vec![[0.0, 0.0, 1.0, 0.0]],
            begin_cap: true,
            end_cap: true,
            ccw: true,
            convex: true,
            solid: true,
            def: None,
            line: 0,
        }
    }
}

impl Extrusion {
    /// Sets all fields but the line to their defaults, keeping the memory.
    pub(super) fn reset(&mut self) {
        fn refill<T: Clone>(field: &mut Vec<T>, default: &[T]) {
            field.clear();
            field.extend_from_slice(default);
        }
        let default = Extrusion::default();
        refill(&mut self.cross_section, &default.cross_section);
        refill(&mut self.spine, &default.spine);
        refill(&mut self.scale, &default.scale);
        refill(&mut self.orientation, &default.orientation);
        let Extrusion { begin_cap, end_cap, ccw, convex, solid, def, .. } = default;
        (self.begin_cap, self.end_cap, self.ccw) = (begin_cap, end_cap, ccw);
        (self.convex, self.solid, self.def) = (convex, solid, def);
    }
}

/// What a reader hands over.
#[derive(Debug)]
pub enum X3dItem<'a> {
    /// The next Extrusion; they are numbered from 0. It shows only where it is placed.
    Extrusion(&'a Extrusion),
    /// Extrusion number `extrusion`, handed over earlier, is shown.
    Place {
        /// Number of the Extrusion.
        extrusion: u64,
        /// From its coordinates to the scene's.
        to_scene: DAffine3,
    },
}

/// Takes the pieces of a file in its order.
pub type Sink<'a> = dyn FnMut(X3dItem<'_>) -> Result<()> + 'a;
