//! Vertices outside the cubes of their leaves, and what of a leaf may reach into the cube of another.
//!
//! The triangles around an edge lie between its leaves, which are in the box of two by two of them if all have one
//! size. So as long as their vertices are in their leaves' cubes, they meet the cube of another leaf only if the edge
//! touches it.
//!
//! A vertex of a cell that went to a corner next to it ([`super::super::corner`]), or into a cell that this one has
//! annexed ([`super::super::crease_extension`]), may be outside. Those at vertices of several leaves are looked at elsewhere
//! ([`super::self_intersections`]).

use super::super::cells::BrickCells;
use super::super::leaves::{Leaves, directions};
use super::bounds::Bounds;
use super::edge_box::{EdgeBox, common};
use crate::lattice::BRICK_CELLS;
use std::collections::HashMap;

/// By leaf, boxes with the edges of the leaf at cells that have such a vertex.
#[derive(Default)]
pub(super) struct OutOfCellEdges(HashMap<u32, Vec<EdgeBox>>);

impl OutOfCellEdges {
    /// Adds cells of a leaf.
    pub(super) fn add(&mut self, leaves: &Leaves, leaf: u32, cells: &[[u8; 3]]) {
        let key = leaves.get(leaf).key;
        for &cell in cells {
            for direction in directions().chain([[0; 3]]) {
                // From the first sample of the leaf there.
                let place = |a: usize| i32::from(cell[a]) - direction[a] * BRICK_CELLS as i32;
                let low = [0, 1, 2].map(place);
                let all = [[0; 3], [BRICK_CELLS as i32; 3]];
                let Some(edges) = common(&[low, low.map(|c| c + 1)], &all) else { continue };
                if let Some(other) = key.neighbour(direction).and_then(|key| leaves.exact(key)) {
                    self.0.entry(other).or_default().push(edges);
                }
            }
        }
    }

    pub(super) fn of(&self, leaf: u32) -> &[EdgeBox] {
        self.0.get(&leaf).map_or(&[], |all| all)
    }
}

/// The cells of a leaf that have a vertex outside its cube.
pub(super) fn straying(cells: &BrickCells, [low, high]: &Bounds) -> Vec<[u8; 3]> {
    let is_outside = |place: &[f32; 3]| (0..3).any(|a| place[a] < low[a] || high[a] < place[a]);
    if !cells.positions.iter().any(is_outside) {
        return Vec::new();
    }
    let strays = |vertex: u32| cells.positions.get(vertex as usize).is_some_and(is_outside);
    let mut found = Vec::new();
    for (j, k) in (0..BRICK_CELLS).flat_map(|k| (0..BRICK_CELLS).map(move |j| (j, k))) {
        let mut bits = cells.row(j, k).active;
        while bits != 0 {
            let cell = [bits.trailing_zeros() as usize, j, k];
            bits &= bits - 1;
            let is_straying = match cells.plain(cell) {
                Some((kind, first)) => (0..u32::from(kind.loops().count)).any(|n| strays(first as u32 + n)),
                None => cells.mixed_edges_of(cell).iter().any(|(_, vertex)| strays(*vertex)),
            };
            if is_straying {
                found.push(cell.map(|c| c as u8));
            }
        }
    }
    found
}
