//! Which bead each triangle of a mesh lies on, from a store that tells beads apart.

use super::beads::solids_of;
use super::sample::leaf_at;
use crate::contour::{Coordinates, FaceAttributes, MeshTriangle};
use crate::error::Result;
use crate::lattice::{NodeKey, ROOT_BITS, Units};
use crate::solid::{Body, Segment, Solids};
use crate::store::{BeadSegment, BeadTables, BrickTree, Store};
use rayon::prelude::*;

/// Triangles that a thread takes at once: neighbours in a mesh are neighbours in space.
const AT_ONCE: usize = 256;
/// A bead whose surface is farther than so many cells is not the triangle's.
const CELLS_AWAY: f64 = 1.5;

/// What is told of the bead of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BeadAttribute {
    /// Its number, from 0, as `overlap` has it.
    Bead,
    /// Its layer, from 1.
    Layer,
    /// Its feature, as an index into the list in the file's comments.
    Feature,
}

impl BeadAttribute {
    fn name(self) -> &'static str {
        match self {
            BeadAttribute::Bead => "bead",
            BeadAttribute::Layer => "layer",
            BeadAttribute::Feature => "feature",
        }
    }
}

/// Finds the beads of triangles.
pub struct FaceBeads<'a> {
    store: &'a Store,
    tables: BeadTables,
    solids: Solids,
    coordinates: Coordinates,
    wanted: Vec<BeadAttribute>,
}

/// A segment of a leaf with its solid.
struct Listed {
    pass: u32,
    a: Units,
    body: Body,
    bounds: (Units, Units),
}

impl<'a> FaceBeads<'a> {
    /// Of a store; `None` if it does not tell beads apart. Triangles have these coordinates.
    ///
    /// # Errors
    /// [`crate::error::Error::Store`] if its tables are damaged.
    pub fn new(
        store: &'a Store,
        coordinates: Coordinates,
        wanted: Vec<BeadAttribute>,
    ) -> Result<Option<FaceBeads<'a>>> {
        let Some(tables) = store.bead_tables()? else { return Ok(None) };
        let solids = solids_of(store, &tables)?;
        Ok(Some(FaceBeads { store, tables, solids, coordinates, wanted }))
    }

    /// The bead at each of some positions of the world; none where no bead's surface is near.
    ///
    /// # Errors
    /// [`crate::error::Error::Store`] if the store is damaged.
    pub fn at(&self, points: &[[f64; 3]]) -> Result<Vec<Option<u32>>> {
        let chunks: Vec<_> =
            points.par_chunks(AT_ONCE).map(|chunk| self.of_chunk(chunk)).collect::<Result<_>>()?;
        Ok(chunks.concat())
    }

    fn of_chunk(&self, points: &[[f64; 3]]) -> Result<Vec<Option<u32>>> {
        let edge = f64::from(1u32 << ROOT_BITS);
        let mut last: Option<(NodeKey, Vec<Listed>)> = None;
        let mut of_point = |point: &[f64; 3]| {
            let units = self.store.root().to_units(*point);
            if !units.iter().all(|u| (1.0..edge).contains(u)) {
                return Ok(None);
            }
            let Some(leaf) = leaf_at(self.store, units.map(|u| u - 1.0)) else { return Ok(None) };
            if last.as_ref().is_none_or(|(key, _)| *key != leaf) {
                let listed = |s: &BeadSegment| {
                    let segment = Segment { a: s.a, b: s.b, profile: s.section, pass: s.pass };
                    let (body, bounds) = (self.solids.body(&segment), self.solids.bounds(&segment));
                    Listed { pass: s.pass, a: s.a, body, bounds }
                };
                last = Some((leaf, self.store.segments(leaf, &self.tables)?.iter().map(listed).collect()));
            }
            let least = -CELLS_AWAY * f64::from(1u32 << leaf.spacing_bits());
            let segments = last.iter().flat_map(|(_, segments)| segments);
            let segments = segments.filter(|listed| listed.is_near(units, -least));
            let depths = segments.filter_map(|listed| Some((listed.depth(units)?, listed.pass)));
            // Of the union's surface it is the bead that reaches farthest out; of equals the one that was laid first.
            let best = depths.filter(|(depth, _)| *depth >= least).reduce(|best, next| {
                if next.0 > best.0 || next.0 == best.0 && next.1 < best.1 { next } else { best }
            });
            Ok(best.map(|(_, pass)| self.tables.bead_of(pass).0))
        };
        points.iter().map(&mut of_point).collect()
    }

    /// The numbers of a bead in a file; -1 of none.
    fn numbers_of(&self, bead: Option<u32>) -> impl Iterator<Item = i32> {
        let number = move |wanted: &BeadAttribute| {
            let Some(bead) = bead else { return -1 };
            let row = &self.tables.beads[bead as usize];
            match wanted {
                BeadAttribute::Bead => bead as i32,
                BeadAttribute::Layer => row.layer as i32 + 1,
                BeadAttribute::Feature => i32::from(row.feature),
            }
        };
        self.wanted.iter().map(number)
    }
}

impl Listed {
    /// Whether a position lies in the box around the solid, or no farther from it than that.
    fn is_near(&self, units: [f64; 3], most: f64) -> bool {
        let (low, high) = self.bounds;
        (0..3).all(|a| (f64::from(low[a]) - most..=f64::from(high[a]) + most).contains(&units[a]))
    }

    /// How far inside the solid a position lies along the lattice's axes, less than 0 outside; nothing where all three lines
    /// through it miss the solid.
    fn depth(&self, units: [f64; 3]) -> Option<f64> {
        let at: [f64; 3] = std::array::from_fn(|n| units[n] - f64::from(self.a[n]));
        let along =
            |axis: usize| self.body.line(axis, at).map(|(from, to)| (at[axis] - from).min(to - at[axis]));
        let depths = [along(0), along(1), along(2)];
        let is_inside = depths.iter().all(|depth| depth.is_some_and(|depth| depth >= 0.0));
        let depths = depths.into_iter().flatten();
        if is_inside { depths.reduce(f64::min) } else { depths.filter(|depth| *depth < 0.0).reduce(f64::max) }
    }
}

impl FaceAttributes for FaceBeads<'_> {
    fn comments(&self) -> Vec<String> {
        if !self.wanted.contains(&BeadAttribute::Feature) {
            return Vec::new();
        }
        let line = |(n, feature): (usize, &String)| {
            let name: String = feature.chars().map(|c| if c.is_ascii_graphic() { c } else { ' ' }).collect();
            format!("feature {n} {name}")
        };
        self.tables.features.iter().enumerate().map(line).collect()
    }

    fn names(&self) -> Vec<&'static str> {
        self.wanted.iter().map(|wanted| wanted.name()).collect()
    }

    fn numbers(&mut self, facets: &[MeshTriangle]) -> Result<Vec<i32>> {
        let base = match self.coordinates {
            Coordinates::Single => [0.0; 3],
            Coordinates::DoubleFrom(base) => base,
        };
        let middle = |facet: &MeshTriangle| -> [f64; 3] {
            std::array::from_fn(|a| {
                base[a] + facet.corners.iter().map(|c| f64::from(c[a])).sum::<f64>() / 3.0
            })
        };
        let beads = self.at(&facets.iter().map(middle).collect::<Vec<_>>())?;
        Ok(beads.into_iter().flat_map(|bead| self.numbers_of(bead).collect::<Vec<_>>()).collect())
    }
}
