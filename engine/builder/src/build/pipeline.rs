//! The main job: mesh files in, store out.

use super::bins::Binner;
use super::clock::Clock;
use super::cost::weigh_soup;
use super::forecast::{ForecastInput, foresee};
use super::open::OpenSoup;
use super::orient;
use super::rebuild::without_wrong_device;
use super::resources::{Resources, SpillResources};
use super::rules::{OPEN, require_no_tolerance};
use super::snap::{SnappedSoup, snap};
use super::soup::Soup;
use super::summary::{BuildSummary, FacetsSummary, InputSummary};
use super::task::Task;
use super::thin::ThinDepth;
use super::toolpaths::{bead_sources, build_beads};
use crate::brick::Count;
use crate::error::{Error, Result};
use crate::ingest::{Facets, Input, Survey};
use crate::lattice::{MAX_LEVEL, RootCube};
use crate::pieces::{Consistency, FlippedSource};
use crate::progress::Progress;
use crate::solid::Outline;
use crate::store::{Compression, Refine, SettingPairs, ShardId, Source, check_target};
use crate::volumes::facet_volumes;
use crate::winding::{FAR_FIELD_BYTES, OpenSummary};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How fine the deepest bricks are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// Depth 4 of meshes: 512 cells along the root's edge, seconds for a million facets, and half a millimetre on a quarter
    /// metre. Of beads as solids cells of at most 0.4 of the least height and width. Of point clouds the depth whose cells are nearest to half the points' spacing.
    Auto,
    /// Deepest level: 32·2^level cells along the root's edge.
    Depth(u8),
    /// Edge of the deepest cells in the input's unit; the root cube is grown to fit.
    Cell(f64),
    /// The root cube of another tree and its deepest level, so that samples of both stand at the same places.
    Like(RootCube, u8),
}

/// [`Resolution::Auto`] of all but point clouds.
pub(super) const AUTO_DEPTH: u8 = 4;

/// Facets whose volumes cost what one more facet in a cube does. Measured on 10 million.
const FACETS_OF_VOLUMES: u64 = 2;

/// Settings of [`build`].
#[derive(Clone, Debug, PartialEq)]
pub struct BuildOptions {
    /// Depth or cell size.
    pub resolution: Resolution,
    /// Criterion above the depth limit.
    pub refine: Refine,
    /// Largest standard deviation of a leaf above the depth limit.
    pub stddev: f64,
    /// How far, in the input's unit, the boundary may be from the mesh of a leaf above the depth limit; 0 divides all that
    /// facets touch. Of closed meshes only.
    pub tolerance: f64,
    /// Largest error of samples of open input; those of closed input are exact.
    pub gwn_error: f64,
    /// Whether bricks in which walls or gaps hide between samples are divided further than [`BuildOptions::resolution`]
    /// says. Of closed meshes and of beads as solids, with [`Refine::Hidden`] and neither a deviation nor a tolerance.
    pub thin: ThinDepth,
    /// The cross-section of beads as analytic solids, for inputs that are all toolpaths; `None` builds from
    /// triangles, those swept along toolpaths included.
    pub solids: Option<Outline>,
    /// What the samples of beads as solids count.
    pub count: Count,
    /// Turn over pieces that are inside out, of inputs that are built from triangles.
    pub orient: Option<Consistency>,
    /// Record in every leaf which beads it counts, where beads are solids.
    pub identity: bool,
    /// Build only this shard of the tree, to be joined with the others by [`super::merge`].
    pub shard: Option<ShardId>,
    /// How payloads are stored. The store has the bytes that [`brickfield_octree::cache::repack`] makes of one with another.
    pub compression: Compression,
    /// What the build may take.
    pub resources: Resources,
    /// What is kept if it is interrupted.
    pub keeping: CommitOptions,
    /// Length unit of the input, recorded in the store.
    pub unit: String,
    /// Program name and version, recorded in the store.
    pub program: String,
}

impl Default for BuildOptions {
    /// The whole tree to the depth that is chosen where none is asked for, samples of open input within a thousandth,
    /// in millimetres, without bounds.
    fn default() -> Self {
        BuildOptions {
            resolution: Resolution::Auto,
            refine: Refine::Hidden,
            stddev: 0.0,
            tolerance: 0.0,
            gwn_error: 1e-3,
            thin: ThinDepth::None,
            solids: None,
            count: Count::default(),
            orient: None,
            identity: false,
            shard: None,
            compression: Compression::Lz4,
            resources: Resources::default(),
            keeping: CommitOptions::default(),
            unit: "mm".to_owned(),
            program: concat!("brickfield-engine ", env!("CARGO_PKG_VERSION")).to_owned(),
        }
    }
}

/// How a build is kept from being lost: it commits now and then what it has, and the same build goes on from there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommitOptions {
    /// Time between two commits: what a crash may cost, beside the pass over the input.
    pub pace: Duration,
    /// Give up what an earlier run has left.
    pub restart: bool,
    /// What decides the store beside these options and the inputs' bytes, by name, as how the inputs were read. A run
    /// with other settings does not go on with what this one leaves.
    pub settings: SettingPairs,
}

impl Default for CommitOptions {
    fn default() -> Self {
        CommitOptions { pace: Duration::from_secs(10), restart: false, settings: SettingPairs::new() }
    }
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
) -> Result<BuildSummary> {
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
) -> Result<BuildSummary> {
    if let Some(outline) = options.solids {
        return build_beads(&bead_sources(opened)?, (outline, options.count), output, options, progress);
    }
    without_wrong_device(options, |options| build_soup(opened, output, options, progress))
}

/// From triangles.
fn build_soup(
    opened: &[Input],
    output: &Path,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<BuildSummary> {
    let mut clock = Clock::default();
    check_target(output)?;
    let MeasuredSoup { bounds, root, depth, sources } = measure_soup(opened, options.resolution, progress)?;
    foresee(&ForecastInput::Facets(opened), (root, depth), bounds, output, options, progress)?;
    let mut task = Task::begin(sources, bounds, root, depth, output, options, None)?;
    clock.lap("measure");
    let given: Vec<&dyn Facets> = opened.iter().map(|input| input as &dyn Facets).collect();
    let turned = orient::turn(&given, root, options.orient, options.resources.memory, progress)?;
    let oriented = turned.as_ref().map(|(_, turned)| turned.apply(&given));
    let soups = oriented.as_ref().map_or(given, |oriented| FlippedSource::sources(oriented));
    clock.lap_if(turned.is_some(), "orient");
    let facets: u64 = opened.iter().map(Input::facets).sum();
    task.cut(|cubes| weigh_soup(&soups, root, cubes, progress), facets / FACETS_OF_VOLUMES)?;
    clock.lap_if(task.meta.shard.is_some(), "weigh");
    let cubes = task.cubes();
    let soup = snapped((opened, &soups), root, (cubes, task.rules.sieved()), &task.room, progress)?;
    task.meta.numbers.facets = facets;
    task.meta.numbers.degenerate_facets = soup.degenerate;
    clock.lap("snap");
    let device = options.resources.device.clone();
    let open = if soup.balance.is_closed() {
        task.build(&Soup { device, open: None }, soup.sorted, progress)?;
        clock.lap("build");
        if task.measures_volumes() {
            let volumes = facet_volumes(&soups, bounds, task.room.memory() / 8, progress);
            task.meta.volumes = task.keep(volumes)?;
            clock.lap("volumes");
        }
        OpenSummary::default()
    } else {
        require_no_tolerance(options.tolerance, OPEN)?;
        options.thin.require_none(OPEN)?;
        if !task.rules.refines_all_touched() {
            require_open_room(task.meta.numbers.facets, &options.resources)?;
            task.rules.evaluate_interior = true;
        }
        let mut sorted = soup.sorted;
        let memory = task.room.memory();
        let open = OpenSoup::close(
            &soups,
            root,
            (options.gwn_error, task.rules.depth),
            (memory, device.as_ref()),
            progress,
        )?;
        opened.iter().try_for_each(Input::check)?;
        task.room.take(open.bytes());
        let summary = open.field.part().summary;
        sorted.push(&Soup::CPU, &cubes, open.caps());
        clock.lap("close");
        task.build(&Soup { device: None, open: Some(open) }, sorted, progress)?;
        clock.lap("build");
        summary
    };
    let inside_out = task.find_inside_out(&soups, progress)?;
    clock.lap_if(inside_out.is_some(), "pieces");
    let read = FacetsSummary {
        facets,
        degenerate_facets: task.meta.numbers.degenerate_facets,
        skipped_faces: opened.iter().map(Input::skipped_faces).sum(),
        open_edges: open.open_edges,
        loops: open.loops,
        flipped_patches: open.flipped_patches,
        pieces: turned.map(|(report, _)| report),
        inside_out,
        turned_sweeps: opened.iter().map(Input::turned_sweeps).sum(),
    };
    task.finish(InputSummary::Facets(read), clock, progress)
}

/// Inputs that have been measured: where they lie, and what they are.
pub(super) struct MeasuredSoup {
    pub bounds: ([f64; 3], [f64; 3]),
    pub root: RootCube,
    pub depth: u8,
    pub sources: Vec<Source>,
}

/// Measures meshes, and lays the lattice under them.
pub(super) fn measure_soup(
    opened: &[Input],
    resolution: Resolution,
    progress: &dyn Progress,
) -> Result<MeasuredSoup> {
    let surveys: Vec<Survey> = opened.iter().map(|input| input.survey(progress)).collect::<Result<_>>()?;
    let bounds = Survey::bounds_of_all(&surveys);
    let (root, depth) = place(opened.first().map(Input::path), bounds.0, bounds.1, resolution)?;
    let sources =
        opened.iter().zip(&surveys).map(|(input, survey)| describe(input, survey.identity)).collect();
    Ok(MeasuredSoup { bounds, root, depth, sources })
}

/// The root cube and the deepest level.
pub(super) fn place(
    first: Option<&Path>,
    min: [f64; 3],
    max: [f64; 3],
    resolution: Resolution,
) -> Result<(RootCube, u8)> {
    place_by(first, (min, max), resolution, |resolution| match resolution {
        Resolution::Auto => RootCube::around(min, max).map(|root| (root, AUTO_DEPTH)),
        Resolution::Depth(depth) => RootCube::around(min, max).map(|root| (root, depth)),
        Resolution::Cell(cell) => RootCube::with_cell(min, max, cell),
        Resolution::Like(root, depth) => Some((root, depth)),
    })
}

/// What `by` makes of a resolution that fits the lattice.
///
/// # Errors
/// If the resolution does not fit it, or `by` finds no cube.
pub(super) fn place_by(
    first: Option<&Path>,
    (min, max): ([f64; 3], [f64; 3]),
    resolution: Resolution,
    by: impl FnOnce(Resolution) -> Option<(RootCube, u8)>,
) -> Result<(RootCube, u8)> {
    if let Resolution::Cell(cell) = resolution {
        let extent = (0..3).map(|a| max[a] - min[a]).fold(0.0, f64::max);
        let finest = extent / 32.0 / f64::from(1u32 << MAX_LEVEL);
        if !(cell > finest && cell.is_finite()) {
            return Err(Error::setting(
                format!("a cell of {cell} is too small for a part of {extent}"),
                format!("use a cell of at least {:.3e}", finest * 1.1),
            ));
        }
    }
    if let Resolution::Like(root, depth) = resolution {
        // Samples on the root's own faces must lie outside the input.
        let margin = root.spacing(depth) / 4.0;
        let far = root.origin.map(|c| c + root.edge);
        let fits = |a: usize| min[a] >= root.origin[a] + margin && max[a] <= far[a] - margin;
        if !(0..3).all(fits) {
            return Err(Error::setting(
                format!(
                    "the input spans {min:?} to {max:?}, and the lattice of `like` {:?} to {far:?}",
                    root.origin
                ),
                "build the larger part first, and the other one like it",
            ));
        }
    }
    by(resolution).ok_or_else(|| {
        let (place, what) = ("bounds", format!("the input spans {min:?} to {max:?}, which fits no lattice"));
        let remedy =
            "it must have an extent, and lie no farther than some millions of its size from the origin";
        match first {
            Some(path) => Error::input(path, place, what, remedy),
            None => Error::setting("there is no input", "give at least one mesh"),
        }
    })
}

pub(super) fn describe(input: &Input, identity: [u8; 32]) -> Source {
    Source {
        path: input.path().display().to_string(),
        bytes: input.bytes(),
        facets: input.facets(),
        format: input.describe().to_owned(),
        blake3: identity,
    }
}

/// The snapped triangles of `opened`, read from `soups`, which are those or what turning has made of them. See [`snap`].
pub(super) fn snapped(
    (opened, soups): (&[Input], &[&dyn Facets]),
    root: RootCube,
    cubes: (Binner, Option<u8>),
    room: &SpillResources,
    progress: &dyn Progress,
) -> Result<SnappedSoup> {
    progress.phase("snapping", Some(opened.iter().map(Input::facets).sum()), "facets");
    let soup = snap(soups, root, cubes, room, progress)?;
    opened.iter().try_for_each(Input::check)?;
    require_area(&soup, opened)?;
    Ok(soup)
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

/// The pieces of an open soup whose nodes decide for themselves stay in memory, those of two levels of nodes at a time. Measured beside the far field: 93
/// bytes a facet of 5 million.
const OPEN_BYTES_A_FACET: u64 = 100;

/// Fails if an open soup does not fit in memory.
fn require_open_room(facets: u64, resources: &Resources) -> Result<()> {
    require_room_for_facets(facets, resources, ("the surface is open", "close the surface"))
}

/// Fails if facets that have to be in memory, and why, need more than there is; `remedy` is what helps beside more memory.
pub(super) fn require_room_for_facets(
    facets: u64,
    resources: &Resources,
    (why, remedy): (&str, &str),
) -> Result<()> {
    let need = facets.saturating_mul(OPEN_BYTES_A_FACET).saturating_add(FAR_FIELD_BYTES);
    if need <= resources.memory {
        return Ok(());
    }
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    Err(Error::setting(
        format!(
            "{why}, and its {facets} facets need {} MiB of the {} MiB that there are",
            mib(need),
            mib(resources.memory)
        ),
        format!("allow more with `memory`, or {remedy}"),
    ))
}
