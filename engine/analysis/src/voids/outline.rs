//! The crossings around each void, for whoever measures them against other bodies.

use super::components::Components;
use super::crossing::each_crossing;
use super::find::Voids;
use crate::brick::SignChanges;
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::progress::Progress;
use crate::store::{BrickTree, Leaf};

/// A crossing of a void's boundary, in lattice units from the root's corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundaryPoint {
    /// Where it is.
    pub at: [f64; 3],
    /// Unit normal, from the solid into the void.
    pub normal: [f64; 3],
}

/// The crossings around the voids that were found, in their order; none around those that open through a throat.
///
/// # Errors
/// What reading the tree gives; [`crate::error::Error::Interrupted`].
pub fn boundary_points(
    tree: &dyn BrickTree,
    found: &Voids,
    progress: &dyn Progress,
) -> Result<Vec<Vec<BoundaryPoint>>> {
    let labelling = &found.labelling;
    let numbers = found.numbers();
    let keys = labelling.order.keys();
    let has_void = |leaf: usize| labelling.in_leaf(leaf).flatten().any(|component| numbers[component] > 0);
    let changes = |key: NodeKey| tree.node(key).is_some_and(|node| node.min != node.max);
    let is_wanted = |leaf: usize| changes(keys[leaf]) && has_void(leaf);
    let make = |number: usize, leaf: &Leaf<'_>, components: &Components| {
        let mut points = Vec::new();
        let pick = |signs: &SignChanges, outer| {
            let void = labelling
                .of(number, components.at_signs(signs, outer))
                .map_or(0, |component| numbers[component]);
            (void > 0).then_some(void)
        };
        each_crossing(leaf.key, leaf.brick, pick, |void, crossing| {
            points.push((void, BoundaryPoint { at: crossing.at, normal: crossing.normal }));
        });
        Ok(points)
    };
    let mut all = vec![Vec::new(); found.voids.len()];
    labelling.visit_some(tree, is_wanted, ("boundaries of voids", progress), make, |points| {
        points.into_iter().for_each(|(void, point)| all[void as usize - 1].push(point));
        Ok(())
    })?;
    Ok(all)
}
