//! The main job: mesh files in, store out.

use super::field::Soup;
use super::jobs::{build_tree, sort_level};
use super::open;
use super::records::EncodedBricks;
use super::rules::{Rules, TreeOptions};
use super::snap::{SnappedSoup, snap};
use crate::error::{Error, Result};
use crate::ingest::{Facets, Input, bounds_of_all};
use crate::lattice::{MAX_LEVEL, RootCube};
use crate::progress::Progress;
use crate::store::{Meta, Numbers, Refine, Source, Stats, StoreWriter, check_target};
use crate::winding::{OpenField, OpenPart, OpenSummary};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How fine the deepest bricks are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// Deepest level: 32·2^level cells along the root's edge.
    Depth(u8),
    /// Edge of the deepest cells in the input's unit; the root cube is grown to fit.
    Cell(f64),
}

/// Settings of [`build`].
#[derive(Clone, Debug, PartialEq)]
pub struct BuildOptions {
    /// Depth or cell size.
    pub resolution: Resolution,
    /// Criterion above the depth limit.
    pub refine: Refine,
    /// Largest standard deviation of a leaf above the depth limit.
    pub stddev: f64,
    /// Largest error of samples of open input; those of closed input are exact.
    pub gwn_error: f64,
    /// Length unit of the input, recorded in the store.
    pub unit: String,
    /// Program name and version, recorded in the store.
    pub program: String,
}

/// What a build did.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Facets read.
    pub facets: u64,
    /// Facets without area on the lattice.
    pub degenerate_facets: u64,
    /// Faces with fewer than three corners, which were left out.
    pub skipped_faces: u64,
    /// Deepest level.
    pub depth: u8,
    /// Cell edge at the deepest level, in the input's unit.
    pub cell: f64,
    /// Nodes in the tree.
    pub nodes: u64,
    /// Leaves among them.
    pub leaves: u64,
    /// Size of the store.
    pub file_bytes: u64,
    /// Directed edges that no reverse cancels; 0 for closed input.
    pub open_edges: u64,
    /// Loops into which they fall.
    pub loops: u64,
    /// Borders of patches that face the wrong way.
    pub flipped_patches: u64,
    /// Seconds by phase, in order.
    pub phases: Vec<(&'static str, f64)>,
}

/// Builds `output` from the soup of all `inputs` on the threads of the current rayon pool.
///
/// The file's bytes depend on the inputs, their paths as given, the order of the paths and the options; not
/// on the threads, nor, but for the inputs' hashes in the metadata, on the order of the facets.
///
/// # Errors
/// Unreadable or damaged input, settings that do not fit it, an output that cannot be written. Nothing
/// is left under the final name unless the build succeeds.
pub fn build(
    inputs: &[PathBuf],
    output: &Path,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<Summary> {
    let opened: Vec<Input> = inputs.iter().map(|path| Input::open(path, progress)).collect::<Result<_>>()?;
    build_opened(&opened, output, options, progress)
}

/// As [`build`], of inputs that are open already.
///
/// # Errors
/// As [`build`].
pub fn build_opened(
    opened: &[Input],
    output: &Path,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<Summary> {
    let mut clock = Clock::default();
    check_target(output)?;
    progress.phase("measuring", Some(opened.iter().map(Input::facets).sum()), "facets");
    let (min, max) = bounds_of_all(opened, progress)?;
    let (root, depth) = place(opened, min, max, options.resolution)?;
    let rules = Rules::new(TreeOptions { depth, refine: options.refine, stddev: options.stddev })?;
    clock.lap("measure");
    let mut meta = Meta {
        program: options.program.clone(),
        sources: opened.iter().map(describe).collect::<Result<_>>()?,
        unit: options.unit.clone(),
        root,
        bounds_min: min,
        bounds_max: max,
        depth,
        refine: options.refine,
        stddev: options.stddev,
        tolerance: None,
        numbers: Numbers::default(),
    };
    let mut writer = StoreWriter::create(output, &meta)?;
    clock.lap("identify");
    progress.phase("snapping", Some(opened.iter().map(Input::facets).sum()), "facets");
    let sources: Vec<&dyn Facets> = opened.iter().map(|input| input as &dyn Facets).collect();
    let soup = snap(&sources, root, sort_level(&rules), progress)?;
    require_area(&soup, opened)?;
    meta.numbers.facets = sources.iter().map(|s| s.facets()).sum();
    meta.numbers.degenerate_facets = soup.degenerate;
    clock.lap("snap");
    let write = |bricks: EncodedBricks| bricks.write(&mut writer);
    let open_summary = if soup.balance.is_closed() {
        build_tree(&Soup, soup.sorted, &rules, progress, write)?;
        OpenSummary::default()
    } else {
        drop(soup);
        let rules = Rules { evaluate_interior: true, ..rules };
        let field = OpenField::new(OpenPart::of(&sources, root, progress)?, options.gwn_error)?;
        clock.lap("close");
        let sorted = open::gather(&field, &sources, root, progress)?;
        build_tree(&field, sorted, &rules, progress, write)?;
        field.part().summary
    };
    clock.lap("build");
    progress.phase("finishing", None, "bytes");
    let Numbers { facets, degenerate_facets, .. } = meta.numbers;
    let Stats { nodes, leaves, file_bytes, .. } = writer.finish(meta)?;
    clock.lap("finish");
    Ok(Summary {
        facets,
        degenerate_facets,
        skipped_faces: opened.iter().map(Input::skipped_faces).sum(),
        depth,
        cell: root.spacing(depth),
        nodes,
        leaves,
        file_bytes,
        open_edges: open_summary.open_edges,
        loops: open_summary.loops,
        flipped_patches: open_summary.flipped_patches,
        phases: clock.laps,
    })
}

/// The root cube and the deepest level.
fn place(opened: &[Input], min: [f64; 3], max: [f64; 3], resolution: Resolution) -> Result<(RootCube, u8)> {
    let placed = match resolution {
        Resolution::Depth(depth) => RootCube::around(min, max).map(|root| (root, depth)),
        Resolution::Cell(cell) => {
            let extent = (0..3).map(|a| max[a] - min[a]).fold(0.0, f64::max);
            let finest = extent / 32.0 / f64::from(1u32 << MAX_LEVEL);
            if !(cell > finest && cell.is_finite()) {
                return Err(Error::setting(
                    format!("a cell of {cell} is too small for a part of {extent}"),
                    format!("use a cell of at least {:.3e}", finest * 1.1),
                ));
            }
            RootCube::with_cell(min, max, cell)
        }
    };
    placed.ok_or_else(|| {
        let (place, what) = ("bounds", format!("the input spans {min:?} to {max:?}, which fits no lattice"));
        let remedy =
            "it must have an extent, and lie no farther than some millions of its size from the origin";
        match opened.first() {
            Some(input) => Error::input(input.path(), place, what, remedy),
            None => Error::setting("there is no input", "give at least one mesh"),
        }
    })
}

fn describe(input: &Input) -> Result<Source> {
    Ok(Source {
        path: input.path().display().to_string(),
        bytes: input.bytes(),
        facets: input.facets(),
        format: input.describe().to_owned(),
        blake3: input.identity()?,
    })
}

/// Fails if no facet has an area.
fn require_area(soup: &SnappedSoup, opened: &[Input]) -> Result<()> {
    match opened.first() {
        Some(first) if soup.degenerate == opened.iter().map(Input::facets).sum::<u64>() => Err(Error::input(
            first.path(),
            "facets",
            format!("none of the {} facets has an area", soup.degenerate),
            "export the mesh again, in a unit in which its details are not lost",
        )),
        _ => Ok(()),
    }
}

/// Time by phase.
struct Clock {
    last: Instant,
    laps: Vec<(&'static str, f64)>,
}

impl Default for Clock {
    fn default() -> Self {
        Clock { last: Instant::now(), laps: Vec::new() }
    }
}

impl Clock {
    fn lap(&mut self, phase: &'static str) {
        let elapsed: Duration = self.last.elapsed();
        self.last = Instant::now();
        self.laps.push((phase, elapsed.as_secs_f64()));
    }
}
