//! Bricks of a grid: samples, and crossings by straight lines between them.

use super::grid::{Grid, GridBox};
use crate::brick::{Brick, Hermite, HermiteEdge, OctNormal, Samples, SignChanges, point_index};
use crate::error::{Error, Result};
use crate::lattice::{Axis, BRICK_CELLS, BRICK_POINTS, MAX_LEVEL, NodeKey, RootCube, dot};
use crate::part::directory_of;
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

/// Bricks that a volume reaches, of each of which a few bytes are remembered: more are refused.
const MOST_BRICKS: usize = 1 << 26;
/// Samples of a face that are read at a time, along an axis.
const FACE_TILE: usize = 32;

/// Winding numbers are not larger, and masks of 8 bits are as large.
const USUAL: f64 = 255.0;
/// Bytes of bricks that wait to be written.
const WAITING_BYTES: u64 = 64 << 20;

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
    /// Whether something solid ends at the border of the volume and was closed there, since nothing tells what lies beyond.
    pub is_cut: bool,
}

/// Writes a volume as a store, on its own lattice. What is solid at its border is closed half a step beyond it, unless
/// the file tells what lies there. Without a reading values are winding numbers. `unit` is the unit of length.
/// What is packed is unpacked into a temporary file in `temp_dir`, or beside the output.
///
/// # Errors
/// [`Error::Input`] if a value is no number, if nothing is solid, or if there is no reading and values are no winding numbers;
/// [`Error::Setting`] if the volume has too many samples or lies too far from the origin; what reading and writing give.
pub fn build_volume(
    grid: &mut Grid,
    (input, output): (&Path, &Path),
    reading: Option<Reading>,
    (unit, program): (&str, &str),
    temp_dir: Option<&Path>,
    progress: &dyn Progress,
) -> Result<VolumeSummary> {
    grid.prepare(temp_dir.unwrap_or_else(|| directory_of(output)), progress)?;
    let grid = &*grid;
    let field = Field::new(input, grid, reading.unwrap_or(Reading::Winding), progress)?;
    if reading.is_none() {
        require_winding_numbers(input, grid, field.range)?;
    }
    let meta = field.meta(input, unit, program)?;
    let mut writer = StoreWriter::create(output, &meta)?;
    write_divided(&field, &mut writer, WAITING_BYTES, ("reading samples", progress))?;
    grid.file().check()?;
    progress.phase("finishing", None, "bytes");
    let stats = writer.finish(meta)?;
    let is_cut = field.margin > 0 && field.outside.is_none();
    Ok(VolumeSummary { stats, range: field.range, depth: field.depth, is_cut })
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
    /// How far what lies beyond the grid is above the surface's value, if the file tells it and it is not solid.
    outside: Option<f64>,
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
        let margin = usize::from(touches_border(grid, reading)?);
        let needed = grid.shape().into_iter().max().unwrap_or(0) + 2 * margin;
        let Some(depth) = (0..=MAX_LEVEL).find(|&level| BRICK_CELLS << level >= needed) else {
            let what = format!("the volume has {needed} samples along an axis");
            return Err(Error::setting(what, format!("at most {} fit", BRICK_CELLS << MAX_LEVEL)));
        };
        let bricks: usize = grid.shape().iter().map(|n| (n + 2 * margin).div_ceil(BRICK_CELLS)).product();
        if bricks > MOST_BRICKS {
            let [x, y, z] = grid.shape();
            let what = format!("its samples reach over {x} × {y} × {z}, which are {bricks} bricks");
            let remedy =
                format!("cut out what matters: at most {MOST_BRICKS} bricks of 32³ samples are read");
            return Err(Error::input(input, "samples", what, remedy));
        }
        let mut field = Field {
            grid,
            reading,
            margin,
            outside: grid.outside().map(|value| reading.of(value).0).filter(|&level| level < 0.0),
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
        let work = |values: &mut Vec<f64>, row: usize| {
            progress.check()?;
            let first = |x: usize| [x, row % up, row / up].map(|place| place * BRICK_CELLS);
            (0..across).map(|x| this.scanned(input, first(x), values)).collect::<Result<Vec<_>>>()
        };
        let (mut range, mut solid) = (self.range, self.solid);
        let window = 4 * rayon::current_num_threads();
        run_ordered(up * deep, window, Vec::new, work, |row: Vec<Scanned>| {
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
        })?;
        (self.range, self.solid) = (range, solid);
        Ok(UniformNodes { counts, values })
    }

    /// Looks at the brick whose first sample this is. The list is room for its values.
    fn scanned(&self, input: &Path, first: [usize; 3], values: &mut Vec<f64>) -> Result<Scanned> {
        let mut found = Scanned { uniform: Some(0), range: [f64::INFINITY, f64::NEG_INFINITY], solid: None };
        let mut least_and_most = [i16::MAX, i16::MIN];
        // What lies beyond the grid along an axis is empty.
        let mut is_beyond = false;
        let (mut low, mut high) = ([0; 3], [0; 3]);
        for a in 0..3 {
            let shape = self.grid.shape()[a];
            let end = first[a] + BRICK_POINTS - self.margin;
            (low[a], high[a]) = (first[a].saturating_sub(self.margin), end.min(shape));
            is_beyond |= end > shape || first[a] < self.margin;
            if low[a] >= high[a] {
                return Ok(found);
            }
        }
        let samples = [low, high];
        let uniform = self.grid.uniform(samples);
        match uniform {
            Some(value) => (values.clear(), values.push(value)).1,
            None => self.grid.read(samples, values)?,
        }
        let [across, up] = [0, 1].map(|a| high[a] - low[a]);
        for (n, &value) in values.iter().enumerate() {
            let ijk = [low[0] + n % across, low[1] + n / across % up, low[2] + n / across / up];
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
                let last = if uniform.is_some() { high.map(|c| c - 1) } else { ijk };
                let [least, most] = found.solid.unwrap_or([ijk; 2]);
                found.solid = Some([
                    std::array::from_fn(|a| least[a].min(ijk[a])),
                    std::array::from_fn(|a| most[a].max(last[a])),
                ]);
            }
        }
        let [least, most] = least_and_most;
        found.uniform = match is_beyond {
            true => (least == 0 && most == 0).then_some(0),
            false => (least == most).then_some(least),
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
            shard: None,
            volumes: None,
        })
    }

    /// The values of a brick with one more on each side: how far each is above the surface's, and the sample. Beyond the grid it
    /// is what the file says, or as far below as the nearest value is above.
    fn block(&self, first: [i64; 3]) -> Result<Vec<(f64, i16)>> {
        let shape = self.grid.shape();
        let near = |a: usize, within: i64| -> usize {
            (first[a] + within - 1 - self.margin as i64).clamp(0, shape[a] as i64 - 1) as usize
        };
        let samples: GridBox =
            [std::array::from_fn(|a| near(a, 0)), std::array::from_fn(|a| near(a, BLOCK as i64 - 1) + 1)];
        let mut values = Vec::new();
        self.grid.read(samples, &mut values)?;
        let [low, high] = samples;
        let [across, up] = [0, 1].map(|a| high[a] - low[a]);
        let level = |n: usize| {
            let within = [n % BLOCK, n / BLOCK % BLOCK, n / BLOCK / BLOCK].map(|c| c as i64);
            let [i, j, k]: [usize; 3] = std::array::from_fn(|a| near(a, within[a]) - low[a]);
            let (level, sample) = self.reading.of(values[(k * up + j) * across + i]);
            let is_beyond = (0..3).any(|a| {
                let ijk = first[a] + within[a] - 1 - self.margin as i64;
                ijk != near(a, within[a]) as i64
            });
            let beyond = self.outside.unwrap_or(-level.abs().max(f64::MIN_POSITIVE));
            if is_beyond { (beyond, 0) } else { (level, sample) }
        };
        Ok((0..BLOCK.pow(3)).map(level).collect())
    }
}

/// Whether anything on the faces of a grid is solid.
fn touches_border(grid: &Grid, reading: Reading) -> Result<bool> {
    let shape = grid.shape();
    let mut values = Vec::new();
    for a in 0..3 {
        let (b, c) = ((a + 1) % 3, (a + 2) % 3);
        for end in [0, shape[a] - 1] {
            for from_b in (0..shape[b]).step_by(FACE_TILE) {
                for from_c in (0..shape[c]).step_by(FACE_TILE) {
                    let (mut low, mut high) = ([0; 3], [0; 3]);
                    (low[a], high[a]) = (end, end + 1);
                    (low[b], high[b]) = (from_b, (from_b + FACE_TILE).min(shape[b]));
                    (low[c], high[c]) = (from_c, (from_c + FACE_TILE).min(shape[c]));
                    match grid.uniform([low, high]) {
                        Some(value) => (values.clear(), values.push(value)).1,
                        None => grid.read([low, high], &mut values)?,
                    }
                    if values.iter().any(|&value| reading.of(value).1 >= 1) {
                        return Ok(true);
                    }
                }
            }
        }
    }
    Ok(false)
}

impl Divided for Field<'_> {
    fn depth(&self) -> u8 {
        self.depth
    }

    fn decided(&self, key: NodeKey) -> Result<Option<i16>> {
        Ok(self.uniform[usize::from(key.level())].of(key.position().map(|c| c as usize)))
    }

    fn brick(&self, key: NodeKey) -> Result<Brick> {
        let block = self.block(key.first_sample().map(i64::from))?;
        let mut samples = Samples::filled(0);
        for (n, &(_, sample)) in block.iter().enumerate() {
            let within = [n % BLOCK, n / BLOCK % BLOCK, n / BLOCK / BLOCK];
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
fn crossing(block: &[(f64, i16)], axis: Axis, low: [usize; 3]) -> HermiteEdge {
    let index = |[i, j, k]: [usize; 3]| ((k + 1) * BLOCK + j + 1) * BLOCK + i + 1;
    let strides = [1, BLOCK, BLOCK * BLOCK];
    let (from, step) = (index(low), strides[axis.index()]);
    let [a, b] = [block[from].0, block[from + step].0];
    let t = a / (a - b);
    // Values fall outward.
    let slope = |at: usize, a: usize| block[at - strides[a]].0 - block[at + strides[a]].0;
    let outward: [f64; 3] = std::array::from_fn(|n| (1.0 - t) * slope(from, n) + t * slope(from + step, n));
    let length = dot(outward, outward).sqrt();
    let mut direction = outward.map(|c| (c / length * NORMAL_SCALE) as i64);
    if direction == [0; 3] {
        direction[axis.index()] = if a > b { 1 } else { -1 };
    }
    let offset = (t * 65536.0).round().clamp(0.0, 65535.0) as u16;
    HermiteEdge { offset, normal: OctNormal::from_integer(direction) }
}
