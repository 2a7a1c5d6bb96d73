//! Whether a void is meant to be, by the CAD part or by the features of the beads around it.

use super::class::Class;
use super::role::{Role, role};
use super::trace::Trace;
use super::void::Void;

/// A void that touches sparse infill with this share of its surface is a cell of it.
const INFILL_LEAST: f64 = 0.1;
/// A pocket has loops around it: outer walls with this share of its surface at least.
const POCKET_LEAST: f64 = 0.25;
/// Layers that a pocket's beads span: one below, two beside, one above.
const POCKET_LAYERS: u32 = 4;

/// The class of a void. With a CAD part a void of which most lies outside that is the part's own: a pocket. Of all others,
/// and of all voids without a CAD part, the features around tell: sparse infill makes a cell of it; outer walls around a void
/// that is wider than the beads and higher than two layers make a pocket; what is left is a flaw. Without beads and CAD part
/// nothing tells.
pub(super) fn class_of(void: &Void, is_sparse: bool) -> Option<Class> {
    if void.cad_share.is_some_and(|share| share < 0.5) {
        return Some(Class::Pocket);
    }
    let by_features = void.trace.as_ref().map(|trace| by_features(void, trace, is_sparse));
    match (void.cad_share, by_features) {
        (Some(_), Some(Class::Infill)) => Some(Class::Infill),
        (Some(_), _) => Some(Class::Flaw),
        (None, class) => class,
    }
}

fn by_features(void: &Void, trace: &Trace, is_sparse: bool) -> Class {
    let share = |role_of: Role| {
        trace.features.iter().filter(|(name, _)| role(name) == role_of).map(|(_, share)| share).sum::<f64>()
    };
    let wide = void.inner_diameter.unwrap_or(0.0) >= trace.width;
    if is_sparse && share(Role::SparseInfill) >= INFILL_LEAST {
        Class::Infill
    } else if share(Role::OuterWall) >= POCKET_LEAST
        && wide
        && trace.layers.1 + 1 >= trace.layers.0 + POCKET_LAYERS
    {
        Class::Pocket
    } else {
        Class::Flaw
    }
}
