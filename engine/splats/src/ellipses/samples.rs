//! Crossings of the leaves of a tree, in cubes along the Morton curve, so that what is near is found.

use crate::brick::{Brick, SignChanges};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, morton};
use crate::progress::Progress;
use crate::store::{BrickTree, Leaf, LeafOrder, visit};
use std::f64::consts::PI;

/// Side of a cube in mean radii of ellipses.
const CUBE_SIDE: f64 = 0.5;
/// Cubes along each side of the root, at most.
const CUBES_MAX: u32 = 1 << 20;

/// A crossing.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfaceSample {
    pub place: [f64; 3],
    pub normal: [f32; 3],
    /// The part of the surface that it stands for.
    pub area: f32,
}

/// Samples by cubes.
pub(super) struct SurfaceSamples {
    pub list: Vec<SurfaceSample>,
    /// Side of the finest cells.
    pub cell: f64,
    /// Radius of circles that have the area of the surface together.
    pub radius: f64,
    /// Least corner of the cubes, and the length of all.
    root: ([f64; 3], f64),
    /// Side of a cube.
    side: f64,
    /// Cubes with samples, along the Morton curve, with the first of their samples; and an end.
    cubes: Vec<(u64, u32)>,
}

impl SurfaceSamples {
    /// The crossings of a tree.
    pub fn new(
        tree: &dyn BrickTree,
        number: u32,
        memory: u64,
        progress: &dyn Progress,
    ) -> Result<SurfaceSamples> {
        let order = LeafOrder::new(tree)?;
        progress.phase("reading crossings", Some(order.keys().len() as u64), "bricks");
        let root = tree.root();
        let cell = root.edge / f64::from(32u32 << tree.deepest_level());
        // Sorting takes as much again.
        let most = memory / (2 * size_of::<SurfaceSample>() as u64);
        let mut list = Vec::new();
        let make = |leaf: &Leaf<'_>| Ok(of_leaf(leaf, |at| root.to_world(at), root.unit()));
        visit(tree, order.keys(), progress, make, |_, found: Vec<SurfaceSample>| {
            list.extend(found);
            if list.len() as u64 > most || list.len() > u32::MAX as usize {
                let what =
                    format!("the crossings of the part take more than the {memory} bytes that they may");
                return Err(Error::setting(
                    what,
                    "allow more `memory`, or build the store with fewer levels",
                ));
            }
            Ok(())
        })?;
        Ok(SurfaceSamples::of(list, cell, (root.to_world([1.0; 3]), root.edge), number))
    }

    /// Samples in cubes for so many ellipses.
    pub fn of(mut list: Vec<SurfaceSample>, cell: f64, root: ([f64; 3], f64), number: u32) -> SurfaceSamples {
        let area: f64 = list.iter().map(|sample| f64::from(sample.area)).sum();
        let radius = (area / (PI * f64::from(number))).sqrt();
        let side = (radius * CUBE_SIDE).max(cell).max(root.1 / f64::from(CUBES_MAX));
        let corner = root.0;
        list.sort_by_cached_key(|sample| morton(cube_of(sample.place, corner, side)));
        let cubes = cubes(&list, corner, side);
        SurfaceSamples { list, cell, radius, root, side, cubes }
    }

    /// About so many of the samples, each of which stands for all that were left out around it.
    pub fn thinned(&self, number: usize) -> SurfaceSamples {
        let step = (self.list.len() / number.max(1)).max(1);
        let mut list: Vec<SurfaceSample> = self.list.iter().skip(step / 2).step_by(step).copied().collect();
        list.iter_mut().for_each(|sample| sample.area *= step as f32);
        // Rounding of their number has changed the area a little.
        let cubes = cubes(&list, self.root.0, self.side);
        SurfaceSamples { list, cubes, ..*self }
    }

    /// Calls `each` with the samples of all cubes that touch a box, and their numbers.
    pub fn near(&self, low: [f64; 3], high: [f64; 3], mut each: impl FnMut(usize, &SurfaceSample)) {
        let [low, high] = [low, high].map(|at| cube_of(at, self.root.0, self.side));
        let wanted = (0..3).map(|a| u64::from(high[a] - low[a] + 1)).product::<u64>();
        if wanted > self.cubes.len() as u64 {
            self.list.iter().enumerate().for_each(|(n, sample)| each(n, sample));
            return;
        }
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    let cube = morton([x, y, z]);
                    let Ok(found) = self.cubes.binary_search_by_key(&cube, |cube| cube.0) else { continue };
                    let samples = self.cubes[found].1 as usize..self.cubes[found + 1].1 as usize;
                    for n in samples {
                        each(n, &self.list[n]);
                    }
                }
            }
        }
    }
}

/// Cubes with samples, which are in their order.
fn cubes(list: &[SurfaceSample], corner: [f64; 3], side: f64) -> Vec<(u64, u32)> {
    let mut cubes: Vec<(u64, u32)> = Vec::new();
    for (n, sample) in list.iter().enumerate() {
        let cube = morton(cube_of(sample.place, corner, side));
        if cubes.last().is_none_or(|last| last.0 != cube) {
            cubes.push((cube, n as u32));
        }
    }
    cubes.push((u64::MAX, list.len() as u32));
    cubes
}

fn cube_of(place: [f64; 3], corner: [f64; 3], side: f64) -> [u32; 3] {
    std::array::from_fn(|a| ((place[a] - corner[a]) / side).clamp(0.0, f64::from(CUBES_MAX)) as u32)
}

/// The crossings of a leaf, without those on its upper faces, which its neighbours have.
fn of_leaf(leaf: &Leaf<'_>, world: impl Fn([f64; 3]) -> [f64; 3], unit: f64) -> Vec<SurfaceSample> {
    let mut found = Vec::new();
    let Brick::Counts { samples, hermite } = leaf.brick else { return found };
    let (base, bits) = (leaf.key.base(), leaf.key.spacing_bits());
    let cell = (1u64 << bits) as f64 * unit;
    let signs = SignChanges::of(samples);
    for axis in Axis::ALL {
        signs.for_crossings(axis, hermite, |from, edge| {
            if from.contains(&BRICK_CELLS) {
                return;
            }
            let mut at: [f64; 3] =
                std::array::from_fn(|a| f64::from(base[a] + 1) + ((from[a] as u64) << bits) as f64);
            at[axis.index()] += edge.fraction() * (1u64 << bits) as f64;
            let normal = edge.normal.to_vector();
            // So many lines of the lattice meet a part of a plane.
            let lines = normal.iter().map(|c| c.abs()).sum::<f64>();
            let area = (cell * cell / lines.max(1.0)) as f32;
            found.push(SurfaceSample { place: world(at), normal: normal.map(|c| c as f32), area });
        });
    }
    found
}
