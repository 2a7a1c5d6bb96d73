//! Crossings of the boundary in a leaf.

use crate::brick::{Brick, HermiteEdge, SignChanges};
use crate::lattice::{Axis, BRICK_CELLS, NodeKey};

/// A crossing of a lattice edge whose end outside belongs to a void, or to the outside.
pub(super) struct VoidCrossing {
    pub axis: Axis,
    pub low_is_inside: bool,
    /// Where it is, in lattice units from the root's corner.
    pub at: [f64; 3],
    /// Unit normal, outward.
    pub normal: [f64; 3],
    /// What of the surface it stands for, in squares of the edge: lines along all axes meet a surface with the sum of its
    /// normal's components.
    pub share: f64,
}

/// Calls `each` with the crossings of the edges that a leaf owns, and with what `pick` gives of their samples outside; those
/// of which it gives nothing are left out.
pub(super) fn each_crossing<T>(
    key: NodeKey,
    brick: &Brick,
    pick: impl Fn(&SignChanges, [usize; 3]) -> Option<T>,
    mut each: impl FnMut(T, VoidCrossing),
) {
    let Brick::Counts { samples, hermite } = brick else { return };
    let signs = SignChanges::of(samples);
    if hermite.edges.each_ref().map(Vec::len) != signs.counts() {
        return;
    }
    let step = f64::from(1u32 << key.spacing_bits());
    for axis in Axis::ALL {
        signs.for_crossings(axis, hermite, |low, edge| {
            if low.iter().any(|&c| c >= BRICK_CELLS) {
                return;
            }
            let (low_is_inside, mut outer) = (signs.is_inside(low), low);
            outer[axis.index()] += usize::from(low_is_inside);
            if let Some(picked) = pick(&signs, outer) {
                each(picked, crossing(key, axis, low, low_is_inside, edge, step));
            }
        });
    }
}

fn crossing(
    key: NodeKey,
    axis: Axis,
    low: [usize; 3],
    low_is_inside: bool,
    edge: HermiteEdge,
    step: f64,
) -> VoidCrossing {
    let mut at = low.map(|c| c as f64);
    at[axis.index()] += edge.fraction();
    let normal = edge.normal.to_vector();
    let share = step * step / normal.iter().map(|c| c.abs()).sum::<f64>();
    let at = [0, 1, 2].map(|a| f64::from(key.base()[a]) + 1.0 + at[a] * step);
    VoidCrossing { axis, low_is_inside, at, normal, share }
}
