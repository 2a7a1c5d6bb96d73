//! Which vertices hang together within a node, and whether what they stand for is a disk that meets the node's
//! border as a plane would.

use super::super::qef::Qef;
use super::super::topology::{SQUARE, edge_index, edge_lower};
use super::crossings::{FROZEN, LeafEdges};
use super::vertex_merge::LEVELS;
use std::sync::LazyLock;

/// By face, number `2·axis + side`, the edges of a cube that bound it.
static FACE_EDGES: LazyLock<[u16; 6]> = LazyLock::new(|| {
    std::array::from_fn(|face| {
        let bounds = |edge: &usize| {
            let (along, lower) = edge_lower(*edge);
            along.index() != face / 2 && lower[face / 2] == face % 2
        };
        (0..12).filter(bounds).fold(0, |edges, edge| edges | 1 << edge)
    })
});

/// Sets of what hangs together, and what tells whether they are disks.
pub(super) struct DiskSets {
    /// One of each set stands for it; the others lead to it.
    parent: Vec<u32>,
    /// Twice the cells, less the ends of the cuts between them, plus twice the edges within: twice the Euler
    /// characteristic of the part of the surface without its border, and 2 for a disk alone.
    euler: Vec<i32>,
    /// Sets that reach a frozen cell.
    is_frozen: Vec<bool>,
}

impl DiskSets {
    /// Each alone.
    pub(super) fn of(count: usize) -> DiskSets {
        DiskSets { parent: (0..count as u32).collect(), euler: vec![2; count], is_frozen: vec![false; count] }
    }

    /// The one that stands for another's set.
    pub(super) fn root(&mut self, mut one: u32) -> usize {
        while self.parent[one as usize] != one {
            let up = self.parent[self.parent[one as usize] as usize];
            self.parent[one as usize] = up;
            one = up;
        }
        one as usize
    }

    /// Whether a set is a disk that reaches no frozen cell.
    pub(super) fn is_disk(&self, root: usize) -> bool {
        !self.is_frozen[root] && self.euler[root] == 2
    }

    /// Makes the set that `from` stands for a part of that of `to`.
    fn link(&mut self, to: usize, from: usize) {
        self.parent[from] = to as u32;
        self.euler[to] += self.euler[from];
        self.is_frozen[to] |= self.is_frozen[from];
    }
}

/// Joins sets where they meet around lattice edges.
pub(super) trait JoinSets {
    fn sets(&mut self) -> &mut DiskSets;

    /// Makes one set of those of two. Returns what stands for it.
    fn unite(&mut self, a: u32, b: u32) -> usize;

    /// Joins across the planes of `level` what meets there at an edge: `around` it by quadrant, where `None` is frozen;
    /// `levels` are those of the planes that hold it. Calls `joined` with what stands for each set that was made.
    fn join_around(
        &mut self,
        around: [Option<u32>; 4],
        levels: [u32; 2],
        level: u32,
        mut joined: impl FnMut(usize),
    ) {
        for n in 0..4 {
            // Quadrants 0, 1 and 2, 3 differ along the first axis, the others along the second.
            if levels[n % 2] != level {
                continue;
            }
            match (around[n], around[(n + 1) % 4]) {
                (Some(a), Some(b)) => {
                    let root = self.unite(a, b);
                    self.sets().euler[root] -= 1;
                    joined(root);
                }
                (Some(one), None) | (None, Some(one)) => {
                    let root = self.sets().root(one);
                    self.sets().is_frozen[root] = true;
                }
                (None, None) => {}
            }
        }
        if levels[0].max(levels[1]) == level
            && let Some(one) = around[0]
        {
            let root = self.sets().root(one);
            self.sets().euler[root] += 2;
        }
    }
}

impl JoinSets for DiskSets {
    fn sets(&mut self) -> &mut DiskSets {
        self
    }

    /// The first one stands for all.
    fn unite(&mut self, a: u32, b: u32) -> usize {
        let (a, b) = (self.root(a), self.root(b));
        let (to, from) = (a.min(b), a.max(b));
        if to != from {
            self.link(to, from);
        }
        to
    }
}

/// Sets of vertices whose part of the surface hangs together within the nodes of a level.
pub(super) struct LevelPatches {
    sets: DiskSets,
    /// The vertices of a set in a ring.
    next: Vec<u32>,
    size: Vec<u32>,
    /// Bit per edge of the node that the set crosses.
    border: Vec<u16>,
    /// Sets whose part of the node's border is none that a disk can have.
    is_bad: Vec<bool>,
    pub sums: Vec<Qef>,
}

impl JoinSets for LevelPatches {
    fn sets(&mut self) -> &mut DiskSets {
        &mut self.sets
    }

    fn unite(&mut self, a: u32, b: u32) -> usize {
        let (a, b) = (self.sets.root(a), self.sets.root(b));
        if a == b {
            return a;
        }
        // The lower one of equal ones, so that the outcome is a matter of the numbers alone.
        let is_first = (self.size[b], a) < (self.size[a], b);
        let (to, from) = if is_first { (a, b) } else { (b, a) };
        self.sets.link(to, from);
        self.next.swap(to, from);
        self.size[to] += self.size[from];
        let (sums, more) = if to < from {
            let (low, high) = self.sums.split_at_mut(from);
            (&mut low[to], &high[0])
        } else {
            let (low, high) = self.sums.split_at_mut(to);
            (&mut high[0], &low[from])
        };
        sums.add_all(more);
        to
    }
}

impl LevelPatches {
    /// Every vertex alone, with the sums of its planes.
    pub(super) fn new(sums: Vec<Qef>) -> LevelPatches {
        let count = sums.len();
        LevelPatches {
            sets: DiskSets::of(count),
            next: (0..count as u32).collect(),
            size: vec![1; count],
            border: vec![0; count],
            is_bad: vec![false; count],
            sums,
        }
    }

    /// The vertices of the set that one of them, `root`, stands for.
    pub(super) fn members(&self, root: usize) -> impl Iterator<Item = u32> + '_ {
        let first = root as u32;
        let mut next = Some(first);
        std::iter::from_fn(move || {
            let this = next?;
            next = Some(self.next[this as usize]).filter(|&next| next != first);
            Some(this)
        })
    }

    /// Joins what hangs together in nodes of `level`, whose parts have been joined, and returns those sets that came
    /// of it and may have one vertex.
    pub(super) fn join(&mut self, crossings: &LeafEdges, level: u8) -> Vec<usize> {
        let mut joined = Vec::new();
        for crossing in crossings.within(level) {
            let around = crossing.vertices.map(|vertex| (vertex < FROZEN).then_some(vertex));
            let levels = crossing.levels.map(u32::from);
            self.join_around(around, levels, level.into(), |root| joined.push(root as u32));
        }
        let mut is_changed = vec![false; self.size.len()];
        for vertex in joined {
            is_changed[self.sets.root(vertex)] = true;
        }
        let mut disks: Vec<usize> = (0..is_changed.len()).filter(|root| is_changed[*root]).collect();
        disks.retain(|&root| self.sets.is_disk(root));
        self.study_borders(crossings, level, &disks);
        disks.retain(|&root| !self.is_bad[root]);
        disks
    }

    /// Finds out which of some disks meet the border of their nodes of `level` otherwise than along one line in each
    /// face that ends on two edges.
    fn study_borders(&mut self, crossings: &LeafEdges, level: u8, disks: &[usize]) {
        for &root in disks {
            self.border[root] = 0;
            self.is_bad[root] = false;
        }
        for crossing in crossings.beyond(level) {
            for (n, [qu, qv]) in SQUARE.into_iter().enumerate() {
                if crossing.vertices[n] < FROZEN {
                    let root = self.sets.root(crossing.vertices[n]);
                    let edge = 1 << edge_index(crossing.axis, 1 - qu, 1 - qv);
                    self.is_bad[root] |= self.border[root] & edge != 0;
                    self.border[root] |= edge;
                }
            }
        }
        for face in crossings.ambiguous.iter().filter(|face| face.level > level) {
            let [a, b] = face.vertices.map(|vertex| self.sets.root(vertex));
            self.is_bad[a] |= a == b;
        }
        for &root in disks {
            let edges = self.border[root];
            self.is_bad[root] |= !crosses_as_a_plane(edges);
        }
    }

    /// When all nodes have been joined, the disks that meet the border of the leaf as a plane may and no face on it
    /// that is cut twice.
    pub(super) fn reaching_out(&mut self, crossings: &LeafEdges) -> Vec<usize> {
        let mut roots = Vec::new();
        for crossing in crossings.within(LEVELS + 1) {
            let own = crossing.vertices.into_iter().filter(|&vertex| vertex < FROZEN);
            roots.extend(own.map(|vertex| self.sets.root(vertex)));
        }
        roots.sort_unstable();
        roots.dedup();
        roots.retain(|&root| self.sets.is_disk(root));
        self.study_borders(crossings, LEVELS, &roots);
        for face in crossings.ambiguous.iter().filter(|face| face.level > LEVELS) {
            for vertex in face.vertices {
                let root = self.sets.root(vertex);
                self.is_bad[root] = true;
            }
        }
        roots.retain(|&root| !self.is_bad[root]);
        roots
    }
}

/// Whether a part that crosses these edges of a cube, each of them once, ends in each face along one line at most.
pub(super) fn crosses_as_a_plane(edges: u16) -> bool {
    edges != 0 && FACE_EDGES.iter().all(|face| matches!((face & edges).count_ones(), 0 | 2))
}
