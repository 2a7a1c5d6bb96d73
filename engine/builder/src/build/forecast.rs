//! What a build will take, before any of it is done: bricks, bytes, time. And what the user should know of cells and size.

use super::choose::{BeadSizes, COARSE_OF_LEAST};
use super::measure::measure;
use super::options::BuildOptions;
use crate::error::{Error, Result};
use crate::ingest::Input;
use crate::lattice::{BRICK_CELLS, RootCube, millimetres};
use crate::part::free_beside;
use crate::progress::Progress;
use crate::store::Refine;
use crate::toolpath::Toolpath;
use std::path::Path;

/// Deepest level at which bricks are told apart: 2 million bits.
const FINEST: u8 = 7;
/// Stored bytes for each brick that facets touch: 1,700 to 3,100 of piles.
const BYTES_A_BRICK: f64 = 2500.0;
/// Stored bytes for each square cell of the beads' own surfaces. Measured on six toolpaths at three depths each: 0.5 to 2.4; the
/// better beads fill what lies between them, the fewer.
const BYTES_A_SQUARE: f64 = 1.0;
/// Seconds of one thread for such a brick. Measured on the same: 0.9, 0.7 and 0.5 ms.
const SECONDS_A_BRICK: f64 = 0.6e-3;
/// Memory of the index for each node, of which there are 8 for 7 leaves.
const INDEX_BYTES_A_BRICK: f64 = 32.0 * 8.0 / 7.0;
/// A refused build would take so many times what there is at least: estimates are too large by less.
const CERTAIN: f64 = 2.5;
/// The same of memory, whose bound the user may have set low on purpose to go on with more later.
const CERTAIN_OF_MEMORY: f64 = 8.0;
/// Nobody waits longer, in seconds.
const TIME_MAX: f64 = 30.0 * 86_400.0;
/// Smaller stores are not held against the free space: writing tells soon enough.
const LARGE_BYTES: f64 = 1e9;
/// Smallest and largest plausible side of a part, in mm.
const PLAUSIBLE: (f64, f64) = (1.0, 1e5);

/// What the pieces of a build are, as far as it tells how many bricks they touch.
pub(super) enum ForecastInput<'a> {
    /// Beads as solids, with their sizes.
    Beads(&'a [&'a Toolpath], Option<BeadSizes>),
    /// Triangles.
    Facets(&'a [Input]),
}

/// Tells the user what a build will take, and of coarse cells and implausible sizes.
///
/// # Errors
/// [`Error::Setting`] if it is more than the disk has free, or than anybody waits for, with the nearest cell that is not.
pub(super) fn foresee(
    pieces: &ForecastInput<'_>,
    (root, depth): (RootCube, u8),
    (min, max): ([f64; 3], [f64; 3]),
    output: &Path,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<()> {
    let size: [f64; 3] = std::array::from_fn(|a| max[a] - min[a]);
    if let Some(text) = implausible(size, &options.unit) {
        progress.warn(&text);
    }
    let limits = Limits::of(output, options);
    let (cell, unit) = (root.spacing(depth), &options.unit);
    match pieces {
        ForecastInput::Beads(paths, sizes) => {
            if let Some(text) = sizes.as_ref().and_then(|sizes| coarse(cell, sizes)) {
                progress.warn(&text);
            }
            let area = surface_of_beads(paths);
            let cost = |level: u8| {
                let bytes = BYTES_A_SQUARE * area / root.spacing(level).powi(2);
                Cost::of(bricks_of_beads(paths, root, level), Some(bytes), options)
            };
            let expected = cost(depth);
            progress.note(&expected.text(cell, unit));
            limits.require(&expected, &cost, (root, depth), unit)
        }
        ForecastInput::Facets(inputs) => {
            let follows =
                options.refine == Refine::Hidden && options.stddev == 0.0 && options.tolerance == 0.0;
            let all = Cost::of(bricks_of_box(size, root, depth), None, options);
            // The area is asked for only where it can matter.
            if !follows || limits.exceeded(&all).is_none() {
                return Ok(());
            }
            let mut area = 0.0;
            progress.phase("foreseeing", Some(inputs.iter().map(Input::facets).sum()), "facets");
            for input in *inputs {
                area += measure(input, 0..input.facets(), root, progress)?.area;
            }
            let cost = |level: u8| {
                let of_area = 1.5 * area / (root.spacing(level) * BRICK_CELLS as f64).powi(2);
                Cost::of(of_area.min(bricks_of_box(size, root, level)), None, options)
            };
            limits.require(&cost(depth), &cost, (root, depth), unit)
        }
    }
}

/// What a build takes, estimated.
struct Cost {
    bricks: f64,
    bytes: f64,
    seconds: f64,
    threads: usize,
}

impl Cost {
    /// Of so many bricks with so many bytes, if these are not known by the bricks.
    fn of(bricks: f64, bytes: Option<f64>, options: &BuildOptions) -> Cost {
        let shards = options.shard.map_or(1.0, |shard| f64::from(shard.of));
        let bytes = bytes.unwrap_or(bricks * BYTES_A_BRICK) / shards;
        let (bricks, threads) = (bricks / shards, rayon::current_num_threads());
        let seconds = bricks * SECONDS_A_BRICK / threads as f64;
        Cost { bricks, bytes, seconds, threads }
    }

    fn text(&self, cell: f64, unit: &str) -> String {
        let Cost { bricks, bytes, seconds, threads } = self;
        let cells = bricks * (BRICK_CELLS as f64).powi(3);
        let threads = if *threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") };
        format!(
            "cells of {} {unit}: about {} bricks of {} cells in all, {} and {} with {threads}",
            short(cell),
            short(bricks.ceil()),
            large(cells),
            amount(*bytes),
            duration(*seconds),
        )
    }
}

/// What there is.
struct Limits {
    /// Bytes free on the output's disk, with what an earlier run has left; `None` if nobody knows.
    free: Option<f64>,
    /// Bytes of memory for the index.
    index: f64,
}

impl Limits {
    fn of(output: &Path, options: &BuildOptions) -> Limits {
        Limits { free: free_beside(output).map(|free| free as f64), index: options.resources.index as f64 }
    }

    /// What there is too little of, as "A is needed and B is there".
    fn exceeded(&self, cost: &Cost) -> Option<String> {
        if let Some(free) = self.free.filter(|free| cost.bytes >= LARGE_BYTES && cost.bytes > CERTAIN * free)
        {
            return Some(format!(
                "about {} would be written and {} are free",
                amount(cost.bytes),
                amount(free)
            ));
        }
        let index = cost.bricks * INDEX_BYTES_A_BRICK;
        if index > CERTAIN_OF_MEMORY * self.index {
            let there = amount(self.index);
            return Some(format!(
                "the index would take about {} and {there} of `memory` are left for it",
                amount(index)
            ));
        }
        (cost.seconds > TIME_MAX)
            .then(|| format!("about {} bricks would take {}", short(cost.bricks), duration(cost.seconds)))
    }

    /// Fails if the build takes more than there is. `cost` is that of any depth.
    fn require(
        &self,
        expected: &Cost,
        cost: &dyn Fn(u8) -> Cost,
        (root, depth): (RootCube, u8),
        unit: &str,
    ) -> Result<()> {
        let Some(what) = self.exceeded(expected) else { return Ok(()) };
        let fits = (0..depth).rev().find(|&level| self.exceeded(&cost(level)).is_none()).unwrap_or(0);
        let (cell, nearest) = (short(root.spacing(depth)), two_digits_up(root.spacing(fits)));
        let cost = cost(fits);
        let remedy = format!(
            "`cell` {nearest}{unit} takes about {} and {}",
            amount(cost.bytes),
            duration(cost.seconds)
        );
        Err(Error::setting(format!("cells of {cell} {unit} are too small: {what}"), remedy))
    }
}

/// Bricks of a level in a box.
fn bricks_of_box(size: [f64; 3], root: RootCube, level: u8) -> f64 {
    let brick = root.spacing(level) * BRICK_CELLS as f64;
    size.iter().map(|side| (side / brick).floor() + 1.0).product()
}

/// The area of the sides of all beads, as if they were boxes and alone, in the square of their unit.
fn surface_of_beads(paths: &[&Toolpath]) -> f64 {
    let of_segment = |path: &Toolpath, bead: usize, number: usize, ends: &[[f64; 3]]| {
        let section = path.section(bead, number);
        2.0 * (section.width + section.height) * length_of(ends)
    };
    let of_bead = |path: &Toolpath, bead: usize| {
        let segments = path.points(bead).windows(2).enumerate();
        segments.map(|(number, ends)| of_segment(path, bead, number, ends)).sum::<f64>()
    };
    paths.iter().flat_map(|path| (0..path.len()).map(move |bead| of_bead(path, bead))).sum()
}

/// The length of a segment, of whose path these are two points.
fn length_of(ends: &[[f64; 3]]) -> f64 {
    (0..3).map(|a| (ends[1][a] - ends[0][a]).powi(2)).sum::<f64>().sqrt()
}

/// Bricks of a level that beads touch: those of level 7 at most that hold a place on a bead, each with all that are in it,
/// or as many as tubes of the beads' length pass through if these are fewer.
fn bricks_of_beads(paths: &[&Toolpath], root: RootCube, level: u8) -> f64 {
    let fine = level.min(FINEST);
    let axis = 1usize << fine;
    let mut occupied = vec![0u64; axis.pow(3).div_ceil(64)];
    let edges = [fine, level].map(|level| root.spacing(level) * BRICK_CELLS as f64);
    let mut along = 0.0;
    for path in paths {
        for bead in 0..path.len() {
            for (number, ends) in path.points(bead).windows(2).enumerate() {
                let section = path.section(bead, number);
                let length = length_of(ends);
                let (across, up) = (1.0 + section.width / edges[1], 1.0 + section.height / edges[1]);
                along += (1.0 + length / edges[1]) * (across * up).min(2.0 * (across + up));
                let steps = (2.0 * length / edges[0]).ceil().clamp(1.0, 4096.0);
                for step in 0..=steps as usize {
                    let part = step as f64 / steps;
                    let [x, y, z]: [f64; 3] = std::array::from_fn(|a| {
                        ends[0][a] + part * (ends[1][a] - ends[0][a]) - root.origin[a]
                    });
                    let half = 0.5 * section.width;
                    for at in [[x - half, y - half, z - section.height], [x + half, y + half, z]] {
                        let [i, j, k] = at.map(|c| ((c / edges[0]).max(0.0) as usize).min(axis - 1));
                        let index = (k * axis + j) * axis + i;
                        occupied[index / 64] |= 1 << (index % 64);
                    }
                }
            }
        }
    }
    let count: u64 = occupied.iter().map(|bits| u64::from(bits.count_ones())).sum();
    let within = count as f64 * 8f64.powi(i32::from(level - fine));
    if level == fine { within } else { within.min(along) }
}

/// What cells lose that are larger than half the least bead.
fn coarse(cell: f64, sizes: &BeadSizes) -> Option<String> {
    let (least, name) = sizes.least();
    if cell <= COARSE_OF_LEAST * least * (1.0 + 1e-9) {
        return None;
    }
    let between = if name == "width" { "lines side by side" } else { "layers" };
    let suits = two_digits_down(sizes.cell());
    Some(format!(
        "cells of {} mm are {} times the bead {name} of {} mm: overlaps and gaps between {between} are lost; `cell` \
         {suits}mm keeps them",
        short(cell),
        short(cell / least),
        short(least),
    ))
}

/// What to think of a part of this size.
fn implausible(size: [f64; 3], unit: &str) -> Option<String> {
    let mm = millimetres(unit)?;
    let largest = size.into_iter().fold(0.0, f64::max) * mm;
    let (how, remedy) = match largest {
        _ if largest < PLAUSIBLE.0 => ("small", "`unit` in if it is in inches, `unit` m if it is in metres"),
        _ if largest > PLAUSIBLE.1 => ("large", "`unit` um if it is in micrometres"),
        _ => return None,
    };
    let [x, y, z] = size.map(short);
    Some(format!("the part is {x} × {y} × {z} {unit}, which is very {how}: is that its unit? {remedy}"))
}

/// Three significant digits.
fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let digits = 2 - value.abs().log10().floor() as i32;
    let step = 10f64.powi(digits);
    let rounded = (value * step).round() / step;
    match digits {
        1.. => format!("{rounded:.*}", digits.min(12) as usize)
            .trim_end_matches('0')
            .trim_end_matches('.')
            .to_owned(),
        _ => format!("{rounded:.0}"),
    }
}

/// Two significant digits, not less than the value.
fn two_digits_up(value: f64) -> String {
    let step = 10f64.powi(1 - value.log10().floor() as i32);
    short((value * step * (1.0 - 1e-9)).ceil() / step)
}

/// Two significant digits, not more than the value.
fn two_digits_down(value: f64) -> String {
    let step = 10f64.powi(1 - value.log10().floor() as i32);
    short((value * step * (1.0 + 1e-9)).floor() / step)
}

fn large(number: f64) -> String {
    let named = [(1e12, "trillion"), (1e9, "billion"), (1e6, "million")];
    match named.iter().find(|(size, _)| number >= *size) {
        Some((size, name)) => format!("{} {name}", short(number / size)),
        None => short(number),
    }
}

fn amount(bytes: f64) -> String {
    let named =
        [(f64::from(1 << 30) * 1024.0, "TiB"), (f64::from(1 << 30), "GiB"), (f64::from(1 << 20), "MiB")];
    match named.iter().find(|(size, _)| bytes >= *size) {
        Some((size, name)) => format!("{} {name}", short(bytes / size)),
        None => format!("{} KiB", short((bytes / 1024.0).ceil())),
    }
}

fn duration(seconds: f64) -> String {
    let named = [(86_400.0 * 365.0, "years"), (86_400.0, "days"), (3600.0, "hours"), (60.0, "minutes")];
    match named.iter().find(|(size, _)| seconds >= 2.0 * size) {
        Some((size, name)) => format!("{:.0} {name}", seconds / size),
        None if seconds < 1.5 => "a second".to_owned(),
        None => format!("{seconds:.0} seconds"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::toolpath::{Attributes, BeadView, Section};

    /// A block of 10 × 10 × 4 mm, of lines 0.4 mm apart in layers of 0.2 mm.
    fn block() -> Toolpath {
        let mut path = Toolpath::default();
        for layer in 0..20 {
            for line in 0..25 {
                let (y, z) = (0.4 * f64::from(line), 0.2 * f64::from(layer + 1));
                let attributes = Attributes { layer, tool: 0, feature: 0, lines: (1, 1), fed: None };
                let section = Section { width: 0.4, height: 0.2 };
                path.push(BeadView {
                    points: &[[0.0, y, z], [10.0, y, z]],
                    axes: &[],
                    sections: &[section],
                    lines: &[],
                    attributes,
                });
            }
        }
        path
    }

    #[test]
    fn bricks_of_a_block_are_those_of_its_box_until_they_are_smaller_than_beads() {
        let (path, size) = (block(), [10.4, 10.0, 4.0]);
        let (root, _) = RootCube::with_cell([-0.2, -0.2, 0.0], [10.2, 9.8, 4.0], 0.08).unwrap();
        for level in [0, 1, 2, 3] {
            let (found, all) = (bricks_of_beads(&[&path], root, level), bricks_of_box(size, root, level));
            // Where the box lies among the bricks may add one along each axis.
            let brick = root.spacing(level) * BRICK_CELLS as f64;
            let most: f64 = size.iter().map(|side| (side / brick).ceil() + 1.0).product();
            assert!(found <= most && found >= 0.4 * all, "{level}: {found} of {all}, {most} at most");
        }
        // Cells of a fortieth of a millimetre and finer: four times as many bricks a level, not eight.
        let deep = [12, 13].map(|level| bricks_of_beads(&[&path], root, level));
        assert!(deep[1] / deep[0] < 4.5, "{deep:?}");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.0763932, 12345.6, 1.0, 0.6].map(short), ["0.0764", "12300", "1", "0.6"]);
        assert_eq!(
            (two_digits_down(0.0763932), two_digits_up(0.0763932)),
            ("0.076".to_owned(), "0.077".to_owned())
        );
        assert_eq!((two_digits_down(0.08), two_digits_up(0.08)), ("0.08".to_owned(), "0.08".to_owned()));
        assert_eq!([3e9, 5e5].map(large), ["3 billion", "500000"]);
        assert_eq!(
            [1.5, 90.0, 200.0, 1e9].map(duration),
            ["2 seconds", "90 seconds", "3 minutes", "32 years"]
        );
    }

    #[test]
    fn coarse_cells_and_implausible_sizes_are_told() {
        let sizes = BeadSizes { height: 0.2, width: 0.45, layer: 0.2 };
        let text = coarse(0.6, &sizes).unwrap();
        assert!(
            text.contains("0.6 mm are 3 times the bead height of 0.2 mm") && text.contains("`cell` 0.076mm"),
            "{text}"
        );
        assert_eq!(coarse(0.1, &sizes), None);
        assert!(implausible([0.3, 0.2, 0.1], "mm").unwrap().contains("0.3 × 0.2 × 0.1 mm"));
        assert!(implausible([0.3, 0.2, 0.1], "in").is_none());
        assert!(implausible([3e5, 0.2, 0.1], "mm").unwrap().contains("very large"));
        assert!(implausible([3e5, 0.2, 0.1], "").is_none());
    }
}
