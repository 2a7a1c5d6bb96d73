//! The tree as the contouring stages see it: its leaves, their surfaces and their cells, cached.

use super::adaptive::{CrossLeafMerges, LeafCandidates, MergedVertices};
use super::buffer_pool::BufferPool;
use super::cache::LeafCache;
use super::cells::BrickCells;
use super::edges::Quad;
use super::envelope::MinimalEdge;
use super::faces::FaceVertices;
use super::frame::{CellFrame, SampleCoordinates};
use super::leaves::{LeafNeighbour, Leaves, cell_in};
use super::options::ContourOptions;
use super::order::in_order;
use super::qef::PlaneSums;
use super::solve::OnSurface;
use super::surface::{HermiteSurface, IsoLevel, LeafSurface};
use super::vertices::LeafVertices;
use crate::error::Result;
use crate::lattice::{Axis, BRICK_CELLS, NodeKey, RootCube};
use crate::progress::Progress;
use crate::store::{BrickTree, Walk};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// What is made of the leaves around one is kept in any case while their triangles are compared with it: what is merged of
/// one takes those around itself to make, and all of them ask for it and for its cells.
const LEAST_FOR_MERGED: usize = 2 << 20;
const LEAST_FOR_CELLS: usize = 8 << 20;

/// The stages that make what is kept of a leaf. They ask the field for what earlier stages have made of it and of the
/// leaves around it, so the field knows them only by what they give.
#[derive(Clone, Copy)]
pub(super) struct LevelSetStages {
    /// Cells and their vertices.
    pub cells: fn(&LevelSet, u32) -> Result<BrickCells>,
    /// Vertices on faces.
    pub faces: fn(&LevelSet, u32, &Arc<BrickCells>) -> Result<FaceVertices>,
    /// What of the cells may be merged within a tolerance.
    pub draft: fn(&LevelSet, u32, f64) -> Result<LeafCandidates>,
    /// What is merged, with what is merged across the borders of leaves.
    pub merged: fn(&LevelSet, u32, &CrossLeafMerges) -> Result<MergedVertices>,
}

/// A level set of a tree, ready to be contoured leaf by leaf from any thread.
pub(super) struct LevelSet<'a> {
    makers: LevelSetStages,
    pub root: RootCube,
    pub leaves: Leaves,
    tree: &'a dyn BrickTree,
    level: IsoLevel,
    surfaces: LeafCache<LeafSurface>,
    cells: LeafCache<BrickCells>,
    faces: LeafCache<FaceVertices>,
    /// Where vertices are merged.
    merging: Option<MergeStages>,
    follows_creases: bool,
    /// Whether vertices of smooth cells stand on the surface, not where planes meet outside of it.
    pub on_surface: OnSurface,
    /// By leaf, for how many leaves polygons are still to be made that may need its cells.
    users: Vec<AtomicU32>,
    /// Room that cells were made in.
    pub spare_sums: BufferPool<PlaneSums>,
    pub spare_quads: BufferPool<Quad>,
}

/// What is made of a leaf beside its cells to merge their vertices.
struct MergeStages {
    /// As in [`ContourOptions::tolerance`].
    tolerance: f64,
    /// As in [`ContourOptions::intersection_free`].
    intersection_free: bool,
    drafts: LeafCache<LeafCandidates>,
    across: CrossLeafMerges,
    merged: LeafCache<MergedVertices>,
    /// By leaf, how many levels the coarsest one around it is above it.
    levels_up: Vec<u8>,
    /// By leaf, for how many leaves vertices are still to be merged for the first time, which takes its draft.
    users: Vec<AtomicU32>,
}

impl<'a> LevelSet<'a> {
    /// Of the level set `level` of `tree`.
    pub(super) fn new(
        tree: &'a dyn BrickTree,
        level: IsoLevel,
        options: &ContourOptions,
        makers: LevelSetStages,
    ) -> Result<LevelSet<'a>> {
        let cache_bytes = options.cache_bytes;
        let leaves = Leaves::new(tree, options.level, level.threshold)?;
        // Surfaces serve only cells between levels; cells are asked for again by every neighbour.
        let merging = (options.tolerance > 0.0).then(|| MergeStages {
            tolerance: options.tolerance,
            intersection_free: options.intersection_free,
            drafts: LeafCache::new(cache_bytes / 4),
            across: CrossLeafMerges::default(),
            merged: LeafCache::new((cache_bytes / 4).max(LEAST_FOR_MERGED)),
            levels_up: (0..leaves.len() as u32).map(|leaf| leaves.levels_up(leaf)).collect(),
            users: counts(&leaves, drafts_needed_by),
        });
        // Several passes ask for cells to merge them, and one makes them of surfaces.
        let (for_surfaces, for_merging, least) = match merging {
            Some(_) => (cache_bytes / 8, cache_bytes / 2, LEAST_FOR_CELLS),
            None => (cache_bytes / 4, 0, 0),
        };
        // Few cells have vertices on their faces.
        let for_faces = cache_bytes / 32;
        let (surfaces, cells) = (
            LeafCache::new(for_surfaces),
            LeafCache::new((cache_bytes - for_surfaces - for_merging - for_faces).max(least)),
        );
        let faces = LeafCache::new(for_faces);
        let users = counts(&leaves, needed_by);
        Ok(LevelSet {
            makers,
            root: tree.root(),
            leaves,
            tree,
            level,
            surfaces,
            cells,
            faces,
            merging,
            follows_creases: options.follow_creases,
            on_surface: OnSurface::Never,
            users,
            spare_sums: BufferPool::default(),
            spare_quads: BufferPool::default(),
        })
    }

    /// How many levels the coarsest leaf around one is above it; none without a tolerance.
    pub(super) fn levels_up(&self, leaf: u32) -> u8 {
        self.merging.as_ref().map_or(0, |merging| merging.levels_up[leaf as usize])
    }

    /// What is merged across the borders of leaves; `None` without a tolerance.
    pub(super) fn across(&self) -> Option<&CrossLeafMerges> {
        self.merging.as_ref().map(|merging| &merging.across)
    }

    /// The tolerance, and whether triangles that meet are looked for; `None` without a tolerance.
    pub(super) fn merging(&self) -> Option<(f64, bool)> {
        self.merging.as_ref().map(|merging| (merging.tolerance, merging.intersection_free))
    }

    /// What is merged across the borders of leaves, which is to be put back.
    pub(super) fn take_across(&mut self) -> CrossLeafMerges {
        self.merging.as_mut().map(|merging| std::mem::take(&mut merging.across)).unwrap_or_default()
    }

    /// From now on this is merged across the borders of leaves.
    pub(super) fn put_across(&mut self, across: CrossLeafMerges) {
        if let Some(merging) = &mut self.merging {
            merging.across = across;
        }
    }

    /// What is merged of a leaf is found anew when it is asked for again.
    pub(super) fn forget(&self, leaf: u32) {
        if let Some(merging) = &self.merging {
            merging.merged.remove(leaf);
        }
    }

    /// An edge of a plain cell that changes sign, along `axis` from a sample of a leaf on, as the leaf has it that makes its
    /// polygon: where an interior node stands for its descendants it may know another of several crossings than a leaf of
    /// the tree beside it. `lattice` and `changes` are of `leaf`.
    pub(super) fn minimal_edge(
        &self,
        (leaf, changes): (u32, &HermiteSurface),
        lattice: &SampleCoordinates,
        (axis, low): (Axis, [usize; 3]),
    ) -> Result<MinimalEdge> {
        let is_upper = |axis: Axis| low[axis.index()] == BRICK_CELLS;
        let (u, v) = axis.others();
        let mut fraction = changes.plane(axis, low).rounded_down();
        if is_upper(u) || is_upper(v) {
            let key = self.leaves.get(leaf).key;
            let lower = std::array::from_fn(|a| key.base()[a] + ((low[a] as i32) << key.spacing_bits()));
            let owner = self.leaves.owner(axis, lower, |at| self.leaves.at(at)).unwrap_or(leaf);
            if owner != leaf
                && let LeafSurface::Changes(changes) = &*self.surface(owner)?
            {
                let there = cell_in(self.leaves.get(owner).key, key, low.map(|c| c as i32));
                fraction = changes.plane(axis, there).rounded_down();
            }
        }
        Ok(MinimalEdge::placed(lattice, axis, low, fraction))
    }

    /// The vertices on faces that a leaf owns.
    pub(super) fn faces(&self, leaf: u32) -> Result<Arc<FaceVertices>> {
        self.faces.get_or_make(leaf, || {
            let faces = (self.makers.faces)(self, leaf, &self.cells(leaf)?)?;
            let bytes = faces.heap_bytes() + size_of::<FaceVertices>();
            Ok((faces, bytes))
        })
    }

    /// Calls `make` for every leaf and `use_item` with what it gives, as [`in_order`]; the tree is told which bricks
    /// come next.
    pub(super) fn in_order<T: Send>(
        &self,
        progress: &dyn Progress,
        make: impl Fn(u32) -> Result<T> + Sync,
        use_item: impl FnMut(T) -> Result<()> + Send,
    ) -> Result<()> {
        let is_read = |leaf: usize| Some(self.leaves.get(leaf as u32)).filter(|leaf| leaf.changes);
        let walk = Walk::new(self.tree, self.leaves.len(), move |leaf| is_read(leaf).map(|leaf| leaf.key));
        let make = |leaf| {
            walk.at(leaf as usize);
            make(leaf)
        };
        in_order(self.leaves.len(), progress, make, use_item)
    }

    pub(super) fn surface(&self, leaf: u32) -> Result<Arc<LeafSurface>> {
        self.surfaces.get_or_make(leaf, || {
            let surface = LeafSurface::load(self.tree, self.leaves.get(leaf), self.level)?;
            let bytes = surface.heap_bytes() + size_of::<LeafSurface>();
            Ok((surface, bytes))
        })
    }

    pub(super) fn cells(&self, leaf: u32) -> Result<Arc<BrickCells>> {
        self.cells.get_or_make(leaf, || {
            let cells = (self.makers.cells)(self, leaf)?;
            let bytes = cells.heap_bytes();
            Ok((cells, bytes))
        })
    }

    /// The vertices of a leaf as the mesh has them.
    pub(super) fn vertices(&self, leaf: u32) -> Result<LeafVertices> {
        let Some(merging) = &self.merging else {
            return Ok(LeafVertices::new(leaf, self.cells(leaf)?, self.faces(leaf)?));
        };
        let merged = merging.merged.get_or_make(leaf, || {
            let merged = (self.makers.merged)(self, leaf, &merging.across)?;
            let bytes = merged.heap_bytes();
            Ok((merged, bytes))
        })?;
        Ok(LeafVertices::merged(leaf, self.cells(leaf)?, self.faces(leaf)?, merged))
    }

    /// What may be merged of a leaf's cells; nothing without a tolerance.
    pub(super) fn draft(&self, leaf: u32) -> Result<Arc<LeafCandidates>> {
        let Some(merging) = &self.merging else { return Ok(Arc::default()) };
        merging.drafts.get_or_make(leaf, || {
            let draft = (self.makers.draft)(self, leaf, merging.tolerance)?;
            let bytes = draft.heap_bytes();
            Ok((draft, bytes))
        })
    }

    /// Normals of the vertices of a leaf, its first ones, that stand for vertices of several.
    pub(super) fn normals_across(&self, leaf: u32) -> Vec<[f32; 3]> {
        self.across().map_or(Vec::new(), |across| across.normals(leaf))
    }

    /// Whether creases are followed through cells without a vertex of their own, see [`super::crease_extension`].
    pub(super) fn follows_creases(&self) -> bool {
        self.follows_creases
    }

    /// True if vertices are merged.
    pub(super) fn merges(&self) -> bool {
        self.merging.is_some()
    }

    /// The first pass has the vertices of a leaf: drafts that the leaves after it do not need are dropped.
    pub(super) fn release_drafts(&self, leaf: u32) {
        let Some(merging) = &self.merging else { return };
        for other in drafts_needed_by(&self.leaves, leaf) {
            if merging.users[other as usize].fetch_sub(1, Ordering::Relaxed) == 1 {
                merging.drafts.remove(other);
            }
        }
    }

    /// The polygons of a leaf are made: what no others need is dropped, so that its room serves the next leaves. A
    /// surface that the cells of a leaf beyond a corner, or of a coarser one, still want is read again.
    pub(super) fn release(&self, leaf: u32) {
        for other in needed_by(&self.leaves, leaf) {
            if self.users[other as usize].fetch_sub(1, Ordering::Relaxed) == 1 {
                self.cells.remove(other);
                self.surfaces.remove(other);
                self.faces.remove(other);
                if let Some(merging) = &self.merging {
                    merging.merged.remove(other);
                }
            }
        }
    }

    /// Where the cells of `key` lie in the world.
    pub(super) fn frame(&self, key: NodeKey) -> CellFrame {
        CellFrame::new(self.root, key)
    }
}

/// The leaves whose cells the polygons and vertices on faces of a leaf may need: its own and those next to it that are no
/// finer. Next to finer leaves it may have active cells without a sign change of its own.
fn needed_by(leaves: &Leaves, leaf: u32) -> Vec<u32> {
    let is_needing = leaves.get(leaf).changes || leaves.has_finer(leaf);
    let one = |side: &LeafNeighbour| match side {
        LeafNeighbour::Same(other) | LeafNeighbour::Coarser(other) => Some(*other),
        _ => None,
    };
    needed(leaves, leaf, is_needing, one)
}

/// The leaves whose drafts the vertices of a leaf may need: its own and those next to it of its level.
fn drafts_needed_by(leaves: &Leaves, leaf: u32) -> Vec<u32> {
    let one = |side: &LeafNeighbour| match side {
        LeafNeighbour::Same(other) => Some(*other),
        _ => None,
    };
    needed(leaves, leaf, leaves.get(leaf).changes, one)
}

/// Those on the sides that count of a leaf that needs any; of another itself alone.
fn needed(
    leaves: &Leaves,
    leaf: u32,
    is_needing: bool,
    counts: impl Fn(&LeafNeighbour) -> Option<u32>,
) -> Vec<u32> {
    if !is_needing {
        return vec![leaf];
    }
    leaves.around(leaf).iter().filter_map(counts).collect()
}

/// For each leaf by how many it is needed.
fn counts<I: IntoIterator<Item = u32>>(
    leaves: &Leaves,
    needed_by: impl Fn(&Leaves, u32) -> I,
) -> Vec<AtomicU32> {
    let mut counts = Vec::new();
    counts.resize_with(leaves.len(), AtomicU32::default);
    for leaf in 0..leaves.len() as u32 {
        for other in needed_by(leaves, leaf) {
            counts[other as usize].fetch_add(1, Ordering::Relaxed);
        }
    }
    counts
}
