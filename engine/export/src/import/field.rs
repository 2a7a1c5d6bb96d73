//! Bricks of a grid: samples, and crossings by straight lines between them.

use super::Grid;
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, Samples, SignChanges, point_index};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, MAX_LEVEL, NodeKey, RootCube, dot};
use crate::progress::Progress;
use crate::schedule::run_ordered;
use crate::store::{BuildCounts, Divided, Meta, Refine, Source, Stats, StoreWriter, hash_of, write_divided};
use std::path::Path;

/// Values of a brick with one more on each side, for gradients.
const BLOCK: usize = BRICK_POINTS + 2;
/// By how much the components of a normal are scaled before they are rounded.
const NORMAL_SCALE: f64 = 1e12;
/// Half a unit of the lattice must survive beside the largest coordinate: this part of the root.
const HALF_UNIT: f64 = 1.0 / 33_554_432.0;

/// Winding numbers are not larger, and masks of 8 bits are as large.
const USUAL: f64 = 255.0;

/// What of a volume's values is solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reading {
    /// Values are winding numbers: solid from 0.5 on. Samples are the nearest whole numbers.
    Winding,
    /// Values are distances: solid below 0.
    Distance,
    /// Solid from this value on.
    Threshold(f64),
}

impl Reading {
    /// How far a value is above the surface's, and the sample that it is.
    fn of(self, value: f64) -> (f64, i16) {
        match self {
            // Conversion saturates.
            Reading::Winding => (value - 0.5, (value + 0.5).floor() as i16),
            Reading::Distance => (-value, i16::from(value < 0.0)),
            Reading::Threshold(least) => (value - least, i16::from(value >= least)),
        }
    }
}

/// What was made of a volume.
#[derive(Clone, Debug)]
pub struct VolumeSummary {
    /// Nodes and bytes of the store.
    pub stats: Stats,
    /// Least and greatest value.
    pub range: [f64; 2],
    /// The deepest level.
    pub depth: u8,
    /// Whether something solid ends at the border of the volume, where it was closed.
    pub is_cut: bool,
}

/// Writes a volume as a store, on its own lattice. What is solid at its border is closed half a step beyond it. Without a
/// reading values are winding numbers. `unit` is the unit of length.
///
/// # Errors
/// [`Error::Input`] if a value is no number, if nothing is solid, or if there is no reading and values are no winding numbers;
/// [`Error::Setting`] if the volume has too many samples or lies too far from the origin; what reading and writing give.
pub fn build_volume(
    grid: &Grid,
    (input, output): (&Path, &Path),
    reading: Option<Reading>,
    (unit, program): (&str, &str),
    progress: &dyn Progress,
) -> Result<VolumeSummary> {
    let field = Field::new(input, grid, reading.unwrap_or(Reading::Winding), progress)?;
    if reading.is_none() {
        require_winding_numbers(input, grid, field.range)?;
    }
    let meta = field.meta(input, unit, program)?;
    let mut writer = StoreWriter::create(output, &meta)?;
    write_divided(&field, &mut writer, "reading samples", progress)?;
    grid.file().check()?;
    progress.phase("finishing", None, "bytes");
    let stats = writer.finish(meta)?;
    Ok(VolumeSummary { stats, range: field.range, depth: field.depth, is_cut: field.margin > 0 })
}

/// Refuses values that are distances or grey values rather than winding numbers.
fn require_winding_numbers(input: &Path, grid: &Grid, [least, greatest]: [f64; 2]) -> Result<()> {
    let lowest = if grid.has_fractions() { -0.5 } else { -USUAL };
    if least >= lowest && greatest <= USUAL {
        return Ok(());
    }
    let what = format!("its values are {least} to {greatest}, which are no winding numbers");
    let remedy =
        "say that they are distances by `volume_as`, or from which value on they are solid by `threshold`";
    Err(Error::input(input, "samples", what, remedy))
}

/// What is known of the samples of a brick.
#[derive(Clone, Copy)]
struct Scanned {
    uniform: Option<i16>,
    range: [f64; 2],
    /// Least and greatest indices of what is solid.
    solid: Option<[[usize; 3]; 2]>,
}

/// A grid on the lattice of a store.
struct Field<'a> {
    grid: &'a Grid,
    reading: Reading,
    /// Samples in front of the grid's first one.
    margin: usize,
    depth: u8,
    /// What is known of the nodes that the grid reaches, level by level.
    uniform: Vec<UniformNodes>,
    range: [f64; 2],
    solid: [[usize; 3]; 2],
}

/// What nodes of a level are if all of their samples are one value, x fastest: those that the grid reaches, since a long thin
/// grid needs a deep level of which it fills little.
struct UniformNodes {
    counts: [usize; 3],
    values: Vec<Option<i16>>,
}

impl UniformNodes {
    /// Of a node; beyond those that the grid reaches all is 0.
    fn of(&self, position: [usize; 3]) -> Option<i16> {
        if (0..3).any(|a| position[a] >= self.counts[a]) {
            return Some(0);
        }
        let ([x, y, z], [across, up, _]) = (position, self.counts);
        self.values[(z * up + y) * across + x]
    }

    /// The nodes of the level above.
    fn above(&self) -> UniformNodes {
        let counts = self.counts.map(|count| count.div_ceil(2));
        let [across, up, _] = counts;
        let node = |n: usize| {
            let position = [n % across, n / across % up, n / across / up];
            let child = |c: usize| {
                let offset = [c & 1, c >> 1 & 1, c >> 2];
                self.of(std::array::from_fn(|a| 2 * position[a] + offset[a]))
            };
            child(0).filter(|_| (1..8).all(|c| child(c) == child(0)))
        };
        let values = (0..counts.iter().product()).map(node).collect();
        UniformNodes { counts, values }
    }
}

impl<'a> Field<'a> {
    fn new(input: &Path, grid: &'a Grid, reading: Reading, progress: &dyn Progress) -> Result<Field<'a>> {
        let margin = usize::from(touches_border(grid, reading));
        let needed = grid.shape().into_iter().max().unwrap_or(0) + 2 * margin;
        let Some(depth) = (0..=MAX_LEVEL).find(|&level| BRICK_CELLS << level >= needed) else {
            let what = format!("the volume has {needed} samples along an axis");
            return Err(Error::setting(what, format!("at most {} fit", BRICK_CELLS << MAX_LEVEL)));
        };
        let mut field = Field {
            grid,
            reading,
            margin,
            depth,
            uniform: Vec::new(),
            range: [f64::INFINITY, f64::NEG_INFINITY],
            solid: [[usize::MAX; 3], [0; 3]],
        };
        let bricks = field.scan(input, progress)?;
        if field.solid[0][0] == usize::MAX {
            let [least, greatest] = field.range;
            let what = format!("nothing in it is solid: its values are {least} to {greatest}");
            let remedy = "say which values are solid by a threshold, or that they are distances";
            return Err(Error::input(input, "samples", what, remedy));
        }
        field.uniform = vec![bricks];
        for _ in 0..depth {
            field.uniform.push(field.uniform[field.uniform.len() - 1].above());
        }
        field.uniform.reverse();
        Ok(field)
    }

    /// Looks at all samples once.
    fn scan(&mut self, input: &Path, progress: &dyn Progress) -> Result<UniformNodes> {
        let counts = self.grid.shape().map(|n| (n + 2 * self.margin).div_ceil(BRICK_CELLS));
        let [across, up, deep] = counts;
        let mut values = Vec::with_capacity(counts.iter().product());
        progress.phase("looking at samples", Some((up * deep) as u64), "rows of bricks");
        let this = &*self;
        let work = |(): &mut (), row: usize| {
            progress.check()?;
            let first = |x: usize| [x, row % up, row / up].map(|place| place * BRICK_CELLS);
            (0..across).map(|x| this.scanned(input, first(x))).collect::<Result<Vec<_>>>()
        };
        let (mut range, mut solid) = (self.range, self.solid);
        let window = 4 * rayon::current_num_threads();
        run_ordered(
            up * deep,
            window,
            || (),
            work,
            |row: Vec<Scanned>| {
                progress.advance(1);
                for brick in row {
                    values.push(brick.uniform);
                    range = [range[0].min(brick.range[0]), range[1].max(brick.range[1])];
                    if let Some([low, high]) = brick.solid {
                        for a in 0..3 {
                            solid[0][a] = solid[0][a].min(low[a]);
                            solid[1][a] = solid[1][a].max(high[a]);
                        }
                    }
                }
                Ok(())
            },
        )?;
        (self.range, self.solid) = (range, solid);
        Ok(UniformNodes { counts, values })
    }

    /// Looks at the brick whose first sample this is.
    fn scanned(&self, input: &Path, first: [usize; 3]) -> Result<Scanned> {
        let mut found = Scanned { uniform: Some(0), range: [f64::INFINITY, f64::NEG_INFINITY], solid: None };
        let mut least_and_most = [i16::MAX, i16::MIN];
        // What lies beyond the grid along an axis is empty.
        let mut is_beyond = false;
        let range = |a: usize| {
            let end = self.grid.shape()[a] + self.margin;
            (first[a].max(self.margin), (first[a] + BRICK_POINTS).min(end), first[a] + BRICK_POINTS > end)
        };
        let ranges = [range(0), range(1), range(2)];
        for (a, (low, _, beyond)) in ranges.iter().enumerate() {
            is_beyond |= *beyond || first[a] < *low;
        }
        for k in ranges[2].0..ranges[2].1 {
            for j in ranges[1].0..ranges[1].1 {
                for i in ranges[0].0..ranges[0].1 {
                    let ijk = [i, j, k].map(|c| c - self.margin);
                    let value = self.grid.value(ijk);
                    if value.is_nan() {
                        let [i, j, k] = ijk;
                        let place = format!("sample [{k}, {j}, {i}]");
                        let remedy = "replace such values, as by numpy.nan_to_num";
                        return Err(Error::input(input, place, "is no number", remedy));
                    }
                    let (_, sample) = self.reading.of(value);
                    found.range = [found.range[0].min(value), found.range[1].max(value)];
                    least_and_most = [least_and_most[0].min(sample), least_and_most[1].max(sample)];
                    if sample >= 1 {
                        let [low, high] = found.solid.unwrap_or([ijk; 2]);
                        let ends = [
                            std::array::from_fn(|a| low[a].min(ijk[a])),
                            std::array::from_fn(|a| high[a].max(ijk[a])),
                        ];
                        found.solid = Some(ends);
                    }
                }
            }
        }
        let [least, most] = least_and_most;
        found.uniform = match (least <= most, is_beyond) {
            (false, _) => Some(0),
            (true, true) => (least == 0 && most == 0).then_some(0),
            (true, false) => (least == most).then_some(least),
        };
        Ok(found)
    }

    fn meta(&self, input: &Path, unit: &str, program: &str) -> Result<Meta> {
        let step = self.grid.spacing();
        let edge = step * (BRICK_CELLS << self.depth) as f64;
        let unplaced = RootCube { origin: [0.0; 3], edge };
        let before = self.margin as f64 * step;
        let origin = self.grid.origin().map(|c| c - before - unplaced.unit());
        let farthest = origin.iter().fold(0.0f64, |most, c| most.max(c.abs())) + edge;
        if edge * HALF_UNIT <= farthest * f64::EPSILON {
            let what = format!("the volume lies {farthest} from the origin, too far for its {edge}");
            return Err(Error::setting(what, "move its origin nearer"));
        }
        let world = |ijk: [usize; 3], beside: f64| -> [f64; 3] {
            std::array::from_fn(|a| self.grid.origin()[a] + (ijk[a] as f64 + beside) * step)
        };
        let file = self.grid.file();
        Ok(Meta {
            program: program.to_owned(),
            sources: vec![Source {
                path: input.display().to_string(),
                bytes: file.len(),
                facets: 0,
                format: self.grid.format().to_owned(),
                blake3: hash_of(file.bytes()),
            }],
            unit: unit.to_owned(),
            root: RootCube { origin, edge },
            bounds_min: world(self.solid[0], -1.0),
            bounds_max: world(self.solid[1], 1.0),
            depth: self.depth,
            refine: Refine::Stddev,
            stddev: 0.0,
            tolerance: None,
            numbers: BuildCounts::default(),
            beads: None,
            share: None,
            volumes: None,
        })
    }

    /// How far the value of a lattice sample is above the surface's, and the sample. Beyond the grid it is as far below as its
    /// nearest value is above.
    fn level(&self, sample: [i64; 3]) -> (f64, i16) {
        let shape = self.grid.shape();
        let ijk = sample.map(|c| c - self.margin as i64);
        let near: [usize; 3] = std::array::from_fn(|a| ijk[a].clamp(0, shape[a] as i64 - 1) as usize);
        let (level, sample) = self.reading.of(self.grid.value(near));
        let is_beyond = (0..3).any(|a| near[a] as i64 != ijk[a]);
        if is_beyond { (-level.abs().max(f64::MIN_POSITIVE), 0) } else { (level, sample) }
    }
}

/// Whether anything on the faces of a grid is solid.
fn touches_border(grid: &Grid, reading: Reading) -> bool {
    let shape = grid.shape();
    (0..3).any(|a| {
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        [0, shape[a] - 1].into_iter().any(|end| {
            (0..shape[b] * shape[c]).any(|n| {
                let mut ijk = [0; 3];
                (ijk[a], ijk[b], ijk[c]) = (end, n % shape[b], n / shape[b]);
                reading.of(grid.value(ijk)).1 >= 1
            })
        })
    })
}

impl Divided for Field<'_> {
    fn depth(&self) -> u8 {
        self.depth
    }

    fn decided(&self, key: NodeKey) -> Result<Option<i16>> {
        Ok(self.uniform[usize::from(key.level())].of(key.position().map(|c| c as usize)))
    }

    fn brick(&self, key: NodeKey) -> Result<Brick> {
        let first = key.first_sample().map(i64::from);
        let mut block = vec![0.0; BLOCK.pow(3)];
        let mut samples = Samples::filled(0);
        for (n, level) in block.iter_mut().enumerate() {
            let within = [n % BLOCK, n / BLOCK % BLOCK, n / BLOCK / BLOCK];
            let (value, sample) = self.level(std::array::from_fn(|a| first[a] + within[a] as i64 - 1));
            *level = value;
            if within.iter().all(|&c| (1..=BRICK_POINTS).contains(&c)) {
                samples.0[point_index(within.map(|c| c - 1))] = sample;
            }
        }
        let signs = SignChanges::of(&samples);
        let mut hermite = Hermite::default();
        for axis in Axis::ALL {
            let mut edges = Vec::new();
            signs.for_edges(axis, |low| edges.push(crossing(&block, axis, low)));
            hermite.edges[axis.index()] = edges;
        }
        Ok(Brick::from_samples(samples, hermite))
    }
}

/// The crossing of a lattice edge of a brick, by the values of its block.
fn crossing(block: &[f64], axis: Axis, low: [usize; 3]) -> HermiteEdge {
    let index = |[i, j, k]: [usize; 3]| ((k + 1) * BLOCK + j + 1) * BLOCK + i + 1;
    let strides = [1, BLOCK, BLOCK * BLOCK];
    let (from, step) = (index(low), strides[axis.index()]);
    let [a, b] = [block[from], block[from + step]];
    let t = a / (a - b);
    // Values fall outward.
    let slope = |at: usize, a: usize| block[at - strides[a]] - block[at + strides[a]];
    let outward: [f64; 3] = std::array::from_fn(|n| (1.0 - t) * slope(from, n) + t * slope(from + step, n));
    let length = dot(outward, outward).sqrt();
    let mut direction = outward.map(|c| (c / length * NORMAL_SCALE) as i64);
    if direction == [0; 3] {
        direction[axis.index()] = if a > b { 1 } else { -1 };
    }
    let offset = (t * 65536.0).round().clamp(0.0, 65535.0) as u16;
    HermiteEdge { offset, normal: OctNormal::from_integer(direction) }
}
