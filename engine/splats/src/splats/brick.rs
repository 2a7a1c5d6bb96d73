//! The cells of a leaf that the boundary passes, with the faces of its crossings.

use super::cluster::{ClusterPoint, CrossingCluster, PARTS, of_crossings};
use crate::brick::{Brick, SignChanges};
use crate::bsp::ONE;
use crate::lattice::{Axis, BRICK_CELLS, NodeKey};

/// A cell of a node with its faces.
pub(super) struct CellClusters {
    pub at: [u8; 3],
    pub clusters: Vec<CrossingCluster>,
    pub clips: u8,
    /// Whether cells of half the size say more.
    pub divided: bool,
}

/// Side of a node's cells in 1/256 of a lattice unit.
pub(super) fn cell_of(key: NodeKey) -> f64 {
    ((1i64 << key.spacing_bits()) * PARTS) as f64
}

/// Centre of a cell of a node.
pub(super) fn centre_of(key: NodeKey, at: [u8; 3]) -> [f64; 3] {
    let (base, cell) = (key.base(), cell_of(key));
    std::array::from_fn(|axis| {
        (i64::from(base[axis] + 1) * PARTS) as f64 + (f64::from(at[axis]) + 0.5) * cell
    })
}

/// The cells of a leaf, x fastest.
pub(super) fn cells(key: NodeKey, brick: &Brick) -> Vec<CellClusters> {
    let Brick::Counts { samples, hermite } = brick else { return Vec::new() };
    if hermite.is_empty() {
        return Vec::new();
    }
    let signs = SignChanges::of(samples);
    let ranks = Axis::ALL.map(|axis| signs.ranks(axis));
    let corner = key.base().map(|c| i64::from(c + 1) * PARTS);
    let bits = key.spacing_bits();
    // The crossing of the edge that begins at a sample, if there is one.
    let crossing = |axis: Axis, sample: [usize; 3]| -> Option<ClusterPoint> {
        if signs.edges(axis, sample[1], sample[2]) >> sample[0] & 1 == 0 {
            return None;
        }
        let edge = hermite.edges[axis.index()][signs.rank(axis, sample, &ranks[axis.index()])];
        let mut place: [i64; 3] = std::array::from_fn(|a| corner[a] + ((sample[a] as i64 * PARTS) << bits));
        place[axis.index()] += ((i64::from(edge.offset) << bits) * PARTS) >> 16;
        let normal = edge.normal.to_vector().map(|c| (c * f64::from(ONE)).round() as i64);
        Some(ClusterPoint { normal, place })
    };
    let mut found = Vec::new();
    let mut crossings = Vec::with_capacity(12);
    for (j, k) in (0..BRICK_CELLS * BRICK_CELLS).map(|row| (row % BRICK_CELLS, row / BRICK_CELLS)) {
        let rows = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[y, z]| signs.row(j + y, k + z));
        let any = rows[0] | rows[1] | rows[2] | rows[3];
        let all = rows[0] & rows[1] & rows[2] & rows[3];
        let mut mixed = (any | any >> 1) & !(all & all >> 1) & 0xffff_ffff;
        while mixed != 0 {
            let i = mixed.trailing_zeros() as usize;
            mixed &= mixed - 1;
            crossings.clear();
            for axis in Axis::ALL {
                for across in [[0, 0], [1, 0], [0, 1], [1, 1]] {
                    let mut sample = [i, j, k];
                    sample[(axis.index() + 1) % 3] += across[0];
                    sample[(axis.index() + 2) % 3] += across[1];
                    crossings.extend(crossing(axis, sample));
                }
            }
            let (clusters, clips) = of_crossings(&crossings, cell_of(key));
            found.push(CellClusters { at: [i as u8, j as u8, k as u8], clusters, clips, divided: false });
        }
    }
    found
}
