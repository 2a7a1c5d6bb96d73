//! Closing of a part: voids, channels and necks that no ball of some diameter enters become solid.
//!
//! The part is grown by the radius of the ball, and what is deeper in the grown part than the radius is solid. Where that is
//! the part alone, its crossings stay as they were.

use super::offset::{OffsetBrick, OffsetField, Solid, offset};
use super::sides::{DeepBrick, Sides};
use super::surface::Surface;
use crate::brick::{Brick, Hermite, HermiteEdge, Samples, SignChanges, point_index, point_position};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, NodeKey};
use crate::part::directory_of;
use crate::part::temporary::BesideFile;
use crate::progress::Progress;
use crate::store::{BrickTree, Divided, Stats, Store, StoreWriter, write_divided};
use std::path::Path;

/// Diameters of balls below so many cells are refused: the part grown by less has gaps that no sample meets.
const LEAST_CELLS: f64 = 2.0;
/// By how much less deep than it is what is filled counts, in cells: more than distances are off by, so that no crossing of the
/// part is moved for that.
const SHALLOWER: f64 = 0.1;

/// Writes a store, closed by balls of a diameter in world units, to another on the same lattice. The part grown stands
/// beside the output meanwhile. `memory` bounds the surfaces that are held.
///
/// A void wider than the diameter by less than a cell may be closed as well.
///
/// # Errors
/// [`Error::Setting`] if the diameter is below two cells or above the diagonal of the part, if the store has no surface, or one in coarser leaves; what reading
/// and writing give.
pub fn close(
    store: &Store,
    diameter: f64,
    output: &Path,
    memory: u64,
    progress: &dyn Progress,
) -> Result<Stats> {
    let cell = store.root().spacing(store.deepest_level());
    if diameter < LEAST_CELLS * cell {
        let least = LEAST_CELLS * cell;
        return Err(Error::setting(
            format!(
                "closing by {diameter} is below two cells, {least:.6}, which is the least that they resolve"
            ),
            "choose a longer one (`close`), or build the store with finer cells",
        ));
    }
    require_finest(store)?;
    let grown = BesideFile::new(output, ".grown");
    let (radius, folder) = (0.5 * diameter, directory_of(output));
    {
        let surface = Surface::new(store, memory / 2, folder, progress)?;
        // What a wider ball cannot enter is nearly the part's convex hull.
        surface.require_within_diagonal("closing by", diameter, "choose a shorter length (`close`)")?;
        offset(store, &surface, Solid::Offset(radius), grown.path(), progress)?;
    }
    let grown_store = Store::open(grown.path(), memory / 4)?;
    let surface = Surface::new(&grown_store, memory / 4, folder, progress)?;
    let field = ClosedField::of(store, &grown_store, &surface, radius)?;
    let meta = store.meta().remade("closed by", diameter);
    let mut writer = StoreWriter::create(output, &meta)?;
    write_divided(&field, &mut writer, memory / 8, ("closing", progress))?;
    writer.finish(meta)
}

/// Refuses a store with a surface in leaves above the deepest level: these have no samples of it.
fn require_finest(store: &Store) -> Result<()> {
    let deepest = store.deepest_level();
    let is_coarse = |key: &NodeKey| {
        key.level() < deepest && store.node(*key).is_some_and(|node| node.leaf && node.uniform().is_none())
    };
    if store.keys().iter().any(is_coarse) {
        return Err(Error::setting(
            "closing needs cells of one size at the surface, and the store has coarser ones",
            "build it again without `tolerance`",
        ));
    }
    Ok(())
}

/// What is solid: the part, and what is deeper in the part grown than the radius. Lengths are in cells.
struct ClosedField<'a> {
    tree: &'a Store,
    sides: Sides<'a>,
    /// The part grown, shrunk again.
    filled: OffsetField<'a>,
    depth: u8,
    /// The first sample of the part's lattice on that of the part grown.
    shift: i64,
}

impl<'a> ClosedField<'a> {
    fn of(tree: &'a Store, grown: &'a Store, surface: &'a Surface, radius: f64) -> Result<ClosedField<'a>> {
        let filled = OffsetField::of(grown, surface, Solid::Offset(-radius - SHALLOWER * surface.cell()))?;
        // Both lattices coincide, by whole bricks.
        let apart = (tree.root().origin[0] - grown.root().origin[0]) / surface.cell();
        let shift = (apart / BRICK_CELLS as f64).round() as i64 * BRICK_CELLS as i64;
        Ok(ClosedField { tree, sides: Sides::new(tree)?, filled, depth: tree.deepest_level(), shift })
    }

    /// What all samples of a node of the part are, if that is one value.
    fn uniform(&self, key: NodeKey) -> Option<i16> {
        let mut at = Some(key);
        while let Some(key) = at {
            match self.tree.node(key) {
                Some(node) => return if node.leaf { node.uniform() } else { None },
                None => at = key.parent(),
            }
        }
        None
    }

    fn first(&self, key: NodeKey) -> [i64; 3] {
        let size = (BRICK_CELLS as i64) << (self.depth - key.level());
        key.position().map(|p| i64::from(p) * size)
    }
}

impl Divided for ClosedField<'_> {
    fn depth(&self) -> u8 {
        self.depth
    }

    fn decided(&self, key: NodeKey) -> Result<Option<i16>> {
        match self.uniform(key) {
            None => Ok(None),
            Some(w) if w >= 1 => Ok(Some(w)),
            Some(w) => {
                let first = self.first(key).map(|c| (c + self.shift) as f64);
                let side = self.filled.side(first, (BRICK_CELLS as i64) << (self.depth - key.level()))?;
                Ok(side.map(|is_filled| if is_filled { 1 } else { w }))
            }
        }
    }

    fn brick(&self, key: NodeKey) -> Result<Brick> {
        let first = self.first(key);
        let part = match self.sides.part(first)? {
            DeepBrick::Samples(brick) => brick,
            DeepBrick::All(inside) => Brick::Uniform(self.uniform(key).unwrap_or(inside.into())).into(),
            // There is none, by `require_finest`.
            DeepBrick::Unknown => self.tree.brick(key)?,
        };
        let filled = self.filled.block(first.map(|c| c + self.shift))?;
        Joined::new(&part, filled).brick()
    }
}

/// A brick of the part, and what is filled of it.
struct Joined<'a> {
    part: &'a Brick,
    was_solid: SignChanges,
    is_solid: SignChanges,
    filled: OffsetBrick<'a>,
}

impl<'a> Joined<'a> {
    fn new(part: &'a Brick, filled: OffsetBrick<'a>) -> Joined<'a> {
        let was_solid = part.signs();
        let is_solid = SignChanges::from_fn(|n| was_solid.is_inside(point_position(n)) || filled.is_solid(n));
        Joined { part, was_solid, is_solid, filled }
    }

    fn brick(&self) -> Result<Brick> {
        let mut samples = match self.part {
            Brick::Uniform(w) => Samples::filled(*w),
            Brick::Counts { samples, .. } => samples.clone(),
        };
        for (n, sample) in samples.0.iter_mut().enumerate() {
            *sample = if self.filled.is_solid(n) { (*sample).max(1) } else { *sample };
        }
        let mut hermite = Hermite::default();
        for axis in Axis::ALL {
            hermite.edges[axis.index()] = self.edges(axis)?;
        }
        Ok(Brick::from_samples(samples, hermite))
    }

    fn edges(&self, axis: Axis) -> Result<Vec<HermiteEdge>> {
        let mut old: Vec<(usize, HermiteEdge)> = Vec::new();
        if let Brick::Counts { hermite, .. } = self.part {
            self.was_solid.for_crossings(axis, hermite, |low, edge| old.push((point_index(low), edge)));
        }
        let mut lows = Vec::new();
        self.is_solid.for_edges(axis, |low| lows.push(low));
        let of = |low: [usize; 3]| {
            let known = old.binary_search_by_key(&point_index(low), |(n, _)| *n).ok().map(|n| old[n].1);
            self.edge(axis, low, known)
        };
        lows.into_iter().map(of).collect()
    }

    /// The crossing of an edge that has one: `known` is the part's, which stays if what is filled ends before it.
    fn edge(&self, axis: Axis, low: [usize; 3], known: Option<HermiteEdge>) -> Result<HermiteEdge> {
        let Some(edge) = known else { return self.filled.crossing(axis, low) };
        let t = edge.fraction();
        let is_low_solid = self.is_solid.is_inside(low);
        let outer = self.filled.end(axis, low, usize::from(is_low_solid))?;
        // The field changes by no more than the way.
        let way = if is_low_solid { 1.0 - t } else { t };
        if outer > way + 2.0 * SHALLOWER {
            return Ok(edge);
        }
        let value = self.filled.on_edge(axis, low, t, None)?.value;
        if value >= 0.0 || outer <= 0.0 {
            return Ok(edge);
        }
        let ends = if is_low_solid { [(t, value), (1.0, outer)] } else { [(0.0, outer), (t, value)] };
        self.filled.root_between(axis, low, ends)
    }
}
