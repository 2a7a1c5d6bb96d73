//! Regions of outer void that open to the outside only through a throat: what a ball of some size cannot leave.
//!
//! A dense grid of clearances, the distances of void samples from solid, is flooded from the widest places down (a merge tree, as
//! in watersheds). Where a basin meets the outside, its throat is as wide as the clearance there, so the largest ball that can leave it
//! is known from one sort. Samples that are nearer to solid fill the basins afterwards, so each has its whole volume.

use super::cad::CadBrick;
use super::components::Run;
use super::labelling::Labelling;
use crate::error::{Error, Result};
use crate::lattice::{BRICK_CELLS, NodeKey, RootCube};
use crate::progress::Progress;
use crate::store::{BrickTree, Store};
use rayon::prelude::*;
use std::ops::Range;

/// Bytes that a sample of the grid takes.
const SAMPLE_BYTES: u64 = 11;
/// Clearance that is told apart, in cells.
const CELLS_MOST: usize = 250;
/// Samples around the part that are outside of it.
const MARGIN: usize = 2;
/// The basin of the outside; of samples that have none yet.
const OUTSIDE: u32 = 0;
const UNSET: u32 = u32::MAX;

/// A region that opens to the outside.
#[derive(Clone, Debug, Default)]
pub(super) struct Pore {
    /// Samples of the grid.
    pub samples: u64,
    /// Those of them that lie beside others.
    pub border: u64,
    /// Sum of their indices.
    sums: [u64; 3],
    low: [usize; 3],
    high: [usize; 3],
    /// Squared clearance where it meets the outside, and its largest one, in cells.
    throat: u16,
    peak: u16,
}

/// Pores of a grid of samples.
pub(super) struct Pores {
    pub pores: Vec<Pore>,
    /// Level of the grid.
    pub level: u8,
    root: RootCube,
    first: [usize; 3],
    size: [usize; 3],
    /// The largest squared clearance that is told.
    most: u16,
    /// By sample: pore, from 1, or 0.
    of: Vec<u32>,
}

impl Pore {
    /// The diameter of the largest ball that can leave, in the unit of `cell`. Round throats are told 0.5 to 2.3 cells too narrow, as
    /// their axes pass between samples; flat ones up to two too narrow, and one too wide.
    pub fn throat(&self, cell: f64) -> f64 {
        2.0 * clearance(self.throat) * cell
    }
}

/// The distance of the boundary for a squared distance between samples: it lies half way to the solid one on average.
fn clearance(squared: u16) -> f64 {
    (f64::from(squared).sqrt() - 0.5).max(0.0)
}

impl Pores {
    pub fn cell(&self) -> f64 {
        self.root.spacing(self.level)
    }

    /// The distance of samples, in units.
    fn step(&self) -> f64 {
        f64::from(1u32 << crate::lattice::spacing_bits(self.level))
    }

    /// The pore of the sample that is nearest to a lattice position from the root's first sample, not above it.
    pub fn at(&self, units: [f64; 3]) -> Option<usize> {
        let step = self.step();
        let mut index = 0;
        for a in [2, 1, 0] {
            let at = ((units[a] / step).round() as usize).checked_sub(self.first[a])?;
            if at >= self.size[a] {
                return None;
            }
            index = index * self.size[a] + at;
        }
        (self.of[index] as usize).checked_sub(1)
    }

    /// Whether a sample of a pore is nearest to a place in a box, in units from the root's first sample.
    pub fn any_in(&self, low: [f64; 3], high: [f64; 3]) -> bool {
        let step = self.step();
        let within = |at: f64, a: usize| {
            ((at / step).round() - self.first[a] as f64).clamp(0.0, self.size[a] as f64) as usize
        };
        let from: [usize; 3] = std::array::from_fn(|a| within(low[a], a));
        let to: [usize; 3] = std::array::from_fn(|a| within(high[a] + step, a));
        (from[2]..to[2]).any(|z| {
            (from[1]..to[1]).any(|y| {
                let row = (z * self.size[1] + y) * self.size[0];
                self.of[row + from[0]..row + to[0].max(from[0])].iter().any(|pore| *pore > 0)
            })
        })
    }

    /// Bytes that it takes.
    pub fn heap_bytes(&self) -> u64 {
        (4 * self.of.len() + size_of::<Pore>() * self.pores.len()) as u64
    }

    /// The diameter of the largest ball inside a pore, as for throats; `None` if it is wider than clearances were told apart.
    pub fn inner(&self, pore: &Pore) -> Option<f64> {
        (pore.peak < self.most).then(|| 2.0 * clearance(pore.peak) * self.cell())
    }

    fn world(&self, at: [f64; 3]) -> [f64; 3] {
        let step = self.step();
        self.root.to_world([0, 1, 2].map(|a| (self.first[a] as f64 + at[a]) * step + 1.0))
    }

    pub fn centroid(&self, pore: &Pore) -> [f64; 3] {
        self.world(pore.sums.map(|sum| sum as f64 / pore.samples.max(1) as f64))
    }

    pub fn bounds(&self, pore: &Pore) -> [[f64; 3]; 2] {
        [self.world(pore.low.map(|c| c as f64 - 0.5)), self.world(pore.high.map(|c| c as f64 + 0.5))]
    }
}

/// What a sample of void in a leaf belongs to: the component that it is labelled with, or where that is the outside, a pore at
/// its place. Pores are numbered behind the components.
pub(super) fn component_at(
    labelling: &Labelling,
    pores: Option<&Pores>,
    (leaf, label): (usize, u16),
    place: impl FnOnce() -> [f64; 3],
) -> Option<usize> {
    labelling.of(leaf, label).or_else(|| Some(labelling.components.len() + pores?.at(place())?))
}

/// Calls `each` with the stretches of a run of samples in a row (j, k) of a leaf that belong to one component or pore, and with
/// that. What is outside may belong to several pores, so its samples come one by one.
pub(super) fn for_stretches(
    (labelling, pores): (&Labelling, Option<&Pores>),
    (leaf, key): (usize, NodeKey),
    (run, j, k): (Run, usize, usize),
    mut each: impl FnMut(Range<u8>, Option<usize>),
) {
    let of = labelling.of(leaf, run.label);
    let Some(pores) = pores.filter(|_| of.is_none()) else { return each(run.from..run.to, of) };
    for i in run.from..run.to {
        let pore = pores.at(place_of(key, [usize::from(i), j, k]));
        each(i..i + 1, pore.map(|pore| labelling.components.len() + pore));
    }
}

/// Where a sample of a leaf lies, in units from the root's first sample.
pub(super) fn place_of(key: NodeKey, sample: [usize; 3]) -> [f64; 3] {
    let step = f64::from(1u32 << key.spacing_bits());
    [0, 1, 2].map(|a| f64::from(key.base()[a]) + sample[a] as f64 * step)
}

/// The pores whose throat is less than `closing` wide, in the store's unit. The grid is the deepest level that `memory`
/// has room for.
///
/// # Errors
/// [`Error::Setting`] if the throat is too wide for the cells; what reading the store gives; [`Error::Interrupted`].
pub(super) fn pores(store: &Store, closing: f64, memory: u64, progress: &dyn Progress) -> Result<Pores> {
    let root = store.root();
    let deepest = store.deepest_level();
    let fits = |level: u8| {
        let (_, size) = place(store, level);
        size.iter().map(|&s| s as u64).product::<u64>() * SAMPLE_BYTES <= memory
    };
    let level = (0..=deepest).rev().find(|&level| fits(level)).unwrap_or(0);
    let radius = 0.5 * closing / root.spacing(level);
    if radius + 1.5 > CELLS_MOST as f64 {
        return Err(Error::setting(
            format!("`closing` {closing} is more than {} cells of {}", 2 * CELLS_MOST, root.spacing(level)),
            "choose a smaller one",
        ));
    }
    let (first, size) = place(store, level);
    progress.phase("clearance of voids", Some(4), "passes");
    let cap = (radius + 1.5).ceil() as u16;
    let mut squared = solid_at(store, level, first, size)?;
    progress.advance(1);
    distances(&mut squared, size, cap);
    progress.check()?;
    progress.advance(1);
    let most = (radius + 0.5).powi(2);
    let (pores, of) = flood(&squared, size, cap, most);
    progress.advance(2);
    Ok(Pores { pores, level, root, first, size, most: cap * cap, of })
}

/// The first sample and the number of samples of a level around the part.
fn place(store: &Store, level: u8) -> ([usize; 3], [usize; 3]) {
    let (root, meta) = (store.root(), store.meta());
    let cell = root.spacing(level);
    let axis = BRICK_CELLS << level;
    let index = |at: f64, a: usize| ((at - root.origin[a]) / cell).floor().clamp(0.0, axis as f64) as usize;
    let first = [0, 1, 2].map(|a| index(meta.bounds_min[a], a).saturating_sub(MARGIN));
    let size = [0, 1, 2].map(|a| (index(meta.bounds_max[a], a) + 1 + MARGIN).min(axis) - first[a]);
    (first, size)
}

/// 0 at solid samples, the largest number elsewhere; x fastest.
fn solid_at(store: &Store, level: u8, first: [usize; 3], size: [usize; 3]) -> Result<Vec<u16>> {
    let mut out = vec![u16::MAX; size.iter().product()];
    let plane = size[0] * size[1];
    out.par_chunks_mut(plane * BRICK_CELLS).enumerate().try_for_each(|(slab, out)| {
        let zs = first[2] + slab * BRICK_CELLS..first[2] + slab * BRICK_CELLS + out.len() / plane;
        for bz in zs.start / BRICK_CELLS..=(zs.end - 1) / BRICK_CELLS {
            for by in first[1] / BRICK_CELLS..=(first[1] + size[1] - 1) / BRICK_CELLS {
                for bx in first[0] / BRICK_CELLS..=(first[0] + size[0] - 1) / BRICK_CELLS {
                    let brick = [bx, by, bz];
                    let Some(key) = NodeKey::new(level, brick.map(|b| b as u32)) else { continue };
                    let Some(held) = CadBrick::of(store, key)? else { continue };
                    let low = [0, 1, 2]
                        .map(|a| (brick[a] * BRICK_CELLS).max(if a == 2 { zs.start } else { first[a] }));
                    let ends = [first[0] + size[0], first[1] + size[1], zs.end];
                    let high = [0, 1, 2].map(|a| ((brick[a] + 1) * BRICK_CELLS).min(ends[a]));
                    for (y, z) in (low[2]..high[2]).flat_map(|z| (low[1]..high[1]).map(move |y| (y, z))) {
                        let row = (z - zs.start) * plane + (y - first[1]) * size[0];
                        for x in low[0]..high[0] {
                            let at = [0, 1, 2].map(|a| [x, y, z][a] - brick[a] * BRICK_CELLS);
                            if held.is_solid(at) {
                                out[row + x - first[0]] = 0;
                            }
                        }
                    }
                }
            }
        }
        Ok(())
    })?;
    Ok(out)
}

/// Squared distances to the nearest 0, no more than those of `cap` samples.
fn distances(squared: &mut [u16], size: [usize; 3], cap: u16) {
    let most = cap * cap;
    squared.par_chunks_mut(size[0]).for_each(|row| {
        let mut away = cap;
        let sweep = |value: &mut u16, away: &mut u16| {
            *away = if *value == 0 { 0 } else { (*away + 1).min(cap) };
            *value = (*value).min(*away * *away);
        };
        row.iter_mut().for_each(|value| sweep(value, &mut away));
        away = cap;
        row.iter_mut().rev().for_each(|value| sweep(value, &mut away));
    });
    let plane = size[0] * size[1];
    squared.par_chunks_mut(plane).for_each(|plane| down(plane, size[0], size[1], cap));
    // Along z each row of a y is on its own: planes are turned, measured, and turned back.
    let rows: Vec<Vec<u16>> = (0..size[1])
        .into_par_iter()
        .map(|y| {
            let row = |z: usize| &squared[z * plane + y * size[0]..][..size[0]];
            let mut turned: Vec<u16> = (0..size[2]).flat_map(|z| row(z).iter().copied()).collect();
            down(&mut turned, size[0], size[2], cap);
            turned
        })
        .collect();
    squared.par_chunks_mut(plane).enumerate().for_each(|(z, plane)| {
        for (y, row) in plane.chunks_mut(size[0]).enumerate() {
            row.copy_from_slice(&rows[y][z * size[0]..][..size[0]]);
            row.iter_mut().for_each(|value| *value = (*value).min(most));
        }
    });
}

/// The least of the squared distances in a column plus the squared distance there, for all columns of a plane.
fn down(plane: &mut [u16], width: usize, height: usize, cap: u16) {
    let mut column = vec![0u16; height];
    for x in 0..width {
        (0..height).for_each(|y| column[y] = plane[y * width + x]);
        for y in 0..height {
            let mut best = u32::from(column[y]);
            for away in 1..usize::from(cap) {
                let square = (away * away) as u32;
                if square >= best {
                    break;
                }
                if y >= away {
                    best = best.min(u32::from(column[y - away]) + square);
                }
                if y + away < height {
                    best = best.min(u32::from(column[y + away]) + square);
                }
            }
            plane[y * width + x] = best as u16;
        }
    }
}

/// What is known of a basin.
#[derive(Clone, Copy)]
struct Basin {
    parent: u32,
    /// Squared clearance where it met the outside.
    throat: Option<u16>,
    peak: u16,
}

struct Basins(Vec<Basin>);

impl Basins {
    fn find(&mut self, mut n: u32) -> u32 {
        while self.0[n as usize].parent != n {
            self.0[n as usize].parent = self.0[self.0[n as usize].parent as usize].parent;
            n = self.0[n as usize].parent;
        }
        n
    }

    /// Two basins meet at a clearance. One that meets the outside where a ball of `most` passes is outside; else it keeps its
    /// throat, and from then on does not grow by other basins.
    fn meet(&mut self, a: u32, b: u32, at: u16, most: f64) {
        let (a, b) = (self.find(a), self.find(b));
        if a == b {
            return;
        }
        let is_out = |n: u32, basins: &Basins| n == OUTSIDE || basins.0[n as usize].throat.is_some();
        match (is_out(a, self), is_out(b, self)) {
            (true, true) => {}
            (false, false) => {
                self.0[a.max(b) as usize].parent = a.min(b);
                self.0[a.min(b) as usize].peak = self.0[a as usize].peak.max(self.0[b as usize].peak);
            }
            (a_is_out, _) => {
                let (out, basin) = if a_is_out { (a, b) } else { (b, a) };
                // Without a place that is wider by a cell than where it opens it is no pore but a part of what it opens to.
                let is_pore =
                    f64::from(at) < most && clearance(self.0[basin as usize].peak) >= clearance(at) + 1.0;
                if is_pore {
                    self.0[basin as usize].throat = Some(at);
                } else {
                    self.0[basin as usize].parent = out;
                }
            }
        }
    }
}

/// Floods void samples from the widest down. Gives the pores, and of each sample its pore from 1 or 0.
fn flood(squared: &[u16], size: [usize; 3], cap: u16, most: f64) -> (Vec<Pore>, Vec<u32>) {
    let mut starts = vec![0usize; usize::from(cap * cap) + 2];
    squared.iter().filter(|s| **s > 0).for_each(|s| starts[usize::from(cap * cap - s) + 1] += 1);
    (1..starts.len()).for_each(|n| starts[n] += starts[n - 1]);
    let mut order = vec![0u32; squared.iter().filter(|s| **s > 0).count()];
    for (index, s) in squared.iter().enumerate().filter(|(_, s)| **s > 0) {
        let next = &mut starts[usize::from(cap * cap - s)];
        order[*next] = index as u32;
        *next += 1;
    }
    let steps = [1, size[0], size[0] * size[1]];
    let place = |index: usize| [index % size[0], index / size[0] % size[1], index / steps[2]];
    let mut of = vec![UNSET; squared.len()];
    let mut basins = Basins(vec![Basin { parent: OUTSIDE, throat: None, peak: u16::MAX }]);
    for &index in &order {
        let index = index as usize;
        let at = place(index);
        let is_edge = (0..3).any(|a| at[a] == 0 || at[a] + 1 == size[a]);
        // It belongs to the widest place beside it, so a slit along a basin's wall takes none of the wall.
        let mut own = is_edge.then_some((OUTSIDE, u16::MAX));
        for a in 0..3 {
            for other in
                [(at[a] > 0).then(|| index - steps[a]), (at[a] + 1 < size[a]).then(|| index + steps[a])]
            {
                let Some(other) = other.filter(|&other| of[other] != UNSET) else { continue };
                if let Some((own, _)) = own {
                    basins.meet(own, of[other], squared[index], most);
                }
                if own.is_none_or(|(_, widest)| squared[other] > widest) {
                    own = Some((of[other], squared[other]));
                }
            }
        }
        let own = own.map(|(own, _)| own);
        let own = own.unwrap_or_else(|| {
            let number = basins.0.len() as u32;
            basins.0.push(Basin { parent: number, throat: None, peak: squared[index] });
            number
        });
        of[index] = basins.find(own);
    }
    gather(of, &mut basins, size)
}

fn gather(mut of: Vec<u32>, basins: &mut Basins, size: [usize; 3]) -> (Vec<Pore>, Vec<u32>) {
    let mut numbers = vec![0u32; basins.0.len()];
    let mut pores: Vec<Pore> = Vec::new();
    for (index, of) in of.iter_mut().enumerate() {
        let basin = if *of == UNSET { OUTSIDE } else { basins.find(*of) };
        let Some(throat) = basins.0[basin as usize].throat else {
            *of = 0;
            continue;
        };
        let number = &mut numbers[basin as usize];
        if *number == 0 {
            let peak = basins.0[basin as usize].peak;
            pores.push(Pore { throat, peak, low: [usize::MAX; 3], ..Pore::default() });
            *number = pores.len() as u32;
        }
        *of = *number;
        let at = [index % size[0], index / size[0] % size[1], index / (size[0] * size[1])];
        let pore = &mut pores[*number as usize - 1];
        pore.samples += 1;
        for (a, at) in at.into_iter().enumerate() {
            pore.sums[a] += at as u64;
            pore.low[a] = pore.low[a].min(at);
            pore.high[a] = pore.high[a].max(at);
        }
    }
    let steps = [1, size[0], size[0] * size[1]];
    for index in (0..of.len()).filter(|&index| of[index] > 0) {
        let at = [index % size[0], index / size[0] % size[1], index / steps[2]];
        let is_border = (0..3).any(|a| {
            at[a] > 0 && of[index - steps[a]] != of[index]
                || at[a] + 1 < size[a] && of[index + steps[a]] != of[index]
        });
        pores[of[index] as usize - 1].border += u64::from(is_border);
    }
    (pores, of)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block of 40³ in a grid of 44³ with a box of 10³ inside, and a channel of this width from it to the outside.
    fn grid(width: usize) -> (Vec<u16>, [usize; 3]) {
        let size = [44; 3];
        let is_solid = |n: usize| {
            let at = [n % 44, n / 44 % 44, n / 44 / 44];
            let is_box = at.iter().all(|c| (15..25).contains(c));
            let is_channel =
                at[0] >= 20 && (18..18 + width).contains(&at[1]) && (18..18 + width).contains(&at[2]);
            at.iter().all(|c| (2..42).contains(c)) && !is_box && !is_channel
        };
        ((0..44usize.pow(3)).map(|n| if is_solid(n) { 0 } else { u16::MAX }).collect(), size)
    }

    #[test]
    fn a_box_with_a_channel_is_a_pore_if_the_ball_is_wider_than_the_channel() {
        for (width, radius, is_pore) in
            [(1, 2.0, true), (3, 3.0, true), (3, 1.2, false), (5, 4.0, true), (5, 2.2, false)]
        {
            let (mut squared, size) = grid(width);
            distances(&mut squared, size, 6);
            let (pores, of) = flood(&squared, size, 6, (radius + 0.5f64).powi(2));
            assert_eq!(pores.len(), usize::from(is_pore), "{width} {radius}");
            let Some(pore) = pores.first() else { continue };
            // So may be those of the channel, which is 17 samples long.
            assert!((1000..=1000 + 17 * width as u64 * width as u64).contains(&pore.samples), "{pore:?}");
            assert!((pore.throat(1.0) - width as f64).abs() <= 1.0, "{width}: {}", pore.throat(1.0));
            assert_eq!(of.iter().filter(|n| **n == 1).count() as u64, pore.samples);
        }
    }

    #[test]
    fn distances_are_those_of_a_search_of_all() {
        let size = [9, 8, 7];
        let solid = |n: usize| crate::lattice::mix(n as u64).is_multiple_of(40);
        let count: usize = size.iter().product();
        let mut squared: Vec<u16> = (0..count).map(|n| if solid(n) { 0 } else { u16::MAX }).collect();
        distances(&mut squared, size, 5);
        let place = |n: usize| [n % 9, n / 9 % 8, n / 72].map(|c| c as i32);
        for (n, squared) in squared.iter().enumerate() {
            let away = |m: usize| (0..3).map(|a| (place(n)[a] - place(m)[a]).pow(2)).sum::<i32>();
            let expected = (0..count).filter(|&m| solid(m)).map(away).min().unwrap().min(25);
            assert_eq!(i32::from(*squared), expected, "{n}");
        }
    }
}
