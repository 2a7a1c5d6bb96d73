//! The crossings of the boundaries of voids: their points, and the beads that they belong to.

use super::around::{SurroundingSegments, Tracer};
use super::components::Components;
use super::crossing::each_crossing;
use super::labelling::Labelling;
use super::points::{OUTER, Point, sort_along_curve};
use super::pores::{Pores, component_at, place_of};
use crate::brick::SignChanges;
use crate::error::Result;
use crate::lattice::{BRICK_CELLS, NodeKey};
use crate::progress::Progress;
use crate::store::{BrickTree, Leaf};
use std::collections::BTreeMap;

/// What is gathered along the boundaries.
#[derive(Default)]
pub(super) struct Boundaries {
    /// Crossings of voids; `None` if there are more than were allowed.
    pub voids: Option<Vec<Point>>,
    /// Crossings of the outer surface; `None` if there are more than were allowed beside those of voids.
    pub outer: Option<Vec<Point>>,
    /// By component the beads around it.
    pub around: BTreeMap<usize, SurroundingSegments>,
}

/// Which points are kept. Where pores are parted from the outside, that shows as points come.
#[derive(Clone, Copy)]
struct Room {
    voids: bool,
    outer: bool,
    /// How many of voids there will be at least, if all are kept.
    of_voids: usize,
}

impl Room {
    fn of(
        labelling: &Labelling,
        is_void: &(dyn Fn(usize) -> bool + Sync),
        pores: Option<&Pores>,
        most: usize,
    ) -> Room {
        let voids = labelling.components.iter().enumerate().filter(|(component, _)| is_void(*component));
        let of_voids = voids.map(|(_, component)| component.sums.crossings).sum::<u64>();
        let fits = |count: u64| pores.is_some() || count <= most as u64;
        let voids = fits(of_voids);
        let outer = fits(of_voids + labelling.outside.crossings);
        Room { voids, outer, of_voids: if voids { of_voids.min(most as u64) as usize } else { 0 } }
    }
}

/// Gathers them. `is_void` picks components, behind which pores are numbered; at most `most_points` points are kept.
///
/// # Errors
/// What reading the tree gives; [`crate::error::Error::Interrupted`].
pub(super) fn boundaries(
    tree: &dyn BrickTree,
    labelling: &Labelling,
    is_void: &(dyn Fn(usize) -> bool + Sync),
    pores: Option<&Pores>,
    tracer: Option<&Tracer<'_>>,
    most_points: usize,
    progress: &dyn Progress,
) -> Result<Boundaries> {
    let keys = labelling.order.keys();
    let has_outer = |leaf: usize| labelling.in_leaf(leaf).any(|c| c.is_none());
    let has_void = |leaf: usize| labelling.in_leaf(leaf).flatten().any(is_void);
    let changes = |key: NodeKey| tree.node(key).is_some_and(|node| node.min != node.max || node.fractions);
    let room = Room::of(labelling, is_void, pores, most_points);
    let is_wanted = |leaf: usize| {
        let has_some = (room.voids || tracer.is_some()) && has_void(leaf) || room.outer && has_outer(leaf);
        has_some && changes(keys[leaf])
    };
    let make = |number: usize, leaf: &Leaf<'_>, components: &Components| {
        let (mut voids, mut outer_surface) = (Vec::new(), Vec::new());
        let mut around: BTreeMap<usize, SurroundingSegments> = BTreeMap::new();
        let segments = match tracer {
            Some(tracer) if has_void(number) || pores.is_some() => Some(tracer.segments(leaf.key)?),
            _ => None,
        };
        let pick = |signs: &SignChanges, outer| {
            let label = (number, components.at_signs(signs, outer));
            let component = component_at(labelling, pores, label, || place_of(leaf.key, outer));
            let is_wanted = match component {
                Some(component) => component >= labelling.components.len() || is_void(component),
                None => room.outer,
            };
            is_wanted.then_some(component)
        };
        each_crossing(leaf.key, leaf.brick, pick, |component, crossing| {
            let points = if component.is_some() { &mut voids } else { &mut outer_surface };
            if component.is_none() || room.voids {
                points.push(Point {
                    at: crossing.at.map(|c| c as f32),
                    normal: crossing.normal.map(|c| c as f32),
                    component: component.map_or(OUTER, |component| component as u32),
                });
            }
            if let (Some(segments), Some(component)) = (&segments, component) {
                around.entry(component).or_default().add(segments, leaf.key, &crossing);
            }
        });
        // Leaves come in Morton order, so all points are in it.
        let (low, edge) = (leaf.key.base().map(f64::from), f64::from(1u32 << leaf.key.spacing_bits()));
        for points in [&mut voids, &mut outer_surface] {
            sort_along_curve(points, low.map(|c| c + 1.0), edge * BRICK_CELLS as f64);
        }
        Ok((voids, outer_surface, around))
    };
    let mut found = Boundaries {
        voids: room.voids.then(|| Vec::with_capacity(room.of_voids)),
        outer: room.outer.then(Vec::new),
        around: BTreeMap::new(),
    };
    let take = |(voids, outer, around): (Vec<Point>, Vec<Point>, BTreeMap<usize, SurroundingSegments>)| {
        found.keep(voids, outer, most_points);
        for (component, part) in around {
            found.around.entry(component).or_default().join(part);
        }
        Ok(())
    };
    labelling.visit_some(tree, is_wanted, ("boundaries of voids", progress), make, take)?;
    Ok(found)
}

impl Boundaries {
    /// Keeps points, those of voids before those of the outer surface.
    fn keep(&mut self, voids: Vec<Point>, outer: Vec<Point>, most: usize) {
        let counts = [&self.voids, &self.outer].map(|points| points.as_ref().map_or(0, Vec::len));
        let of_voids = counts[0] + voids.len();
        if of_voids + counts[1] + outer.len() > most {
            self.outer = None;
        }
        if of_voids > most {
            self.voids = None;
        }
        self.voids.iter_mut().for_each(|all| all.extend(&voids));
        self.outer.iter_mut().for_each(|all| all.extend(&outer));
    }
}
