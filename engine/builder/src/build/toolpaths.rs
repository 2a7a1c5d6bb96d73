//! The main job straight from toolpaths: beads as analytic solids in, store out.

use super::choose::{BeadSizes, with_cell, with_depth};
use super::clock::Clock;
use super::cost::weigh_pieces;
use super::forecast::{ForecastInput, foresee};
use super::identity::{ListSources, ListedNodes, write_identity};
use super::mesh_inputs::describe;
use super::options::{BuildOptions, Resolution};
use super::pipeline::{BuildContext, BuildSource, build_from};
use super::place::{place, place_by};
use super::rules::{SOLIDS, require_no_tolerance};
use super::solids::sort_segments;
use super::sorted::SortedPieces;
use super::summary::{BeadsSummary, BuildSummary, InputSummary};
use super::task::Task;
use crate::brick::Count;
use crate::error::{Error, Result};
use crate::ingest::Input;
use crate::lattice::RootCube;
use crate::progress::Progress;
use crate::solid::{Outline, Segment, SolidProfile, Solids, bounds_of_beads, passes_of};
use crate::store::{BeadRow, BeadTables, BeadsMeta, IdentityPlace, SectionRow, Source};
use crate::toolpath::{Attributes, Passes, Toolpath};
use crate::volumes::bead_volumes;
use std::path::Path;

/// What measuring the volumes of a segment costs, in the time that one more segment in a cube does.
const VOLUMES_OF_SEGMENT: u64 = 16;

/// A toolpath and the file that it was read from.
#[derive(Clone, Debug)]
pub struct BeadSource<'a> {
    /// The beads.
    pub toolpath: &'a Toolpath,
    /// The file, as the store will name it.
    pub source: Source,
    /// Names of the features that the beads refer to.
    pub features: Vec<String>,
}

/// Builds `output` from the beads of all toolpaths together, on the threads of the current rayon pool. A
/// sample counts the passes, or the beads, that cover it.
///
/// The file's bytes depend on the toolpaths, their sources and the options; not on the threads.
///
/// # Errors
/// Toolpaths without beads or with positions that are not finite, settings that do not fit them, an output
/// that cannot be written. Nothing is left under the final name unless the build succeeds.
pub fn build_beads(
    sources: &[BeadSource<'_>],
    (outline, count): (Outline, Count),
    output: &Path,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<BuildSummary> {
    require_no_tolerance(options.tolerance, SOLIDS)?;
    let paths: Vec<&Toolpath> = sources.iter().map(|source| source.toolpath).collect();
    let passes = passes_of(&paths, count);
    let source = SolidsSource { sources, outline, count, paths, passes, segments: 0, named: None };
    build_from(source, BuildContext { output, options, progress })
}

/// Beads as solids, as what a store is built from.
struct SolidsSource<'a> {
    sources: &'a [BeadSource<'a>],
    outline: Outline,
    count: Count,
    paths: Vec<&'a Toolpath>,
    /// The passes of each path.
    passes: Vec<Passes>,
    segments: u64,
    /// All segments, if the store is to name beads.
    named: Option<Vec<Segment>>,
}

impl BuildSource for SolidsSource<'_> {
    type Field = Solids;

    fn begin(&mut self, BuildContext { output, options, progress }: BuildContext<'_>) -> Result<Task> {
        progress.phase("measuring", None, "beads");
        let bounds = bounds_of_sources(self.sources, self.outline)?;
        let first = self.sources.first().map(|source| Path::new(&source.source.path));
        let sizes = BeadSizes::of(&self.paths);
        let (root, depth) = place_beads(first, bounds, options.resolution, sizes.as_ref())?;
        let pieces = ForecastInput::Beads(&self.paths, sizes);
        foresee(&pieces, (root, depth), bounds, output, options, progress)?;
        let described = self.sources.iter().map(|source| source.source.clone()).collect();
        let identity = options.identity.then(IdentityPlace::default);
        let section = self.outline.name().to_owned();
        let passes = (self.count == Count::Passes).then_some(0);
        let beads = BeadsMeta { section, beads: 0, segments: 0, identity, passes };
        Task::begin(described, bounds, root, depth, output, options, Some(beads))
    }

    fn sort(
        &mut self,
        task: &mut Task,
        clock: &mut Clock,
        BuildContext { options, progress, .. }: BuildContext<'_>,
    ) -> Result<(Solids, SortedPieces<Solids>)> {
        let (outline, root) = (self.outline, task.meta.root);
        if task.measures_volumes() {
            let (memory, bounds) =
                (options.resources.memory / 8, (task.meta.bounds_min, task.meta.bounds_max));
            task.meta.volumes = Some(bead_volumes(&self.counted(), outline, bounds, memory, progress)?);
            clock.lap("volumes");
        }
        let (solids, segments) = Solids::of_passes(&self.counted(), root, outline)?;
        let other = VOLUMES_OF_SEGMENT * segments.len() as u64;
        task.cut(|cubes| weigh_pieces(&solids, &segments, cubes, progress), other)?;
        clock.lap_if(task.meta.shard.is_some(), "weigh");
        progress.phase("sorting", Some(segments.len() as u64), "segments");
        let sorted = sort_segments(&solids, &segments, task.cubes(), progress)?;
        self.segments = segments.len() as u64;
        if let Some(beads) = &mut task.meta.beads {
            beads.beads = self.paths.iter().map(|path| path.len() as u64).sum();
            beads.segments = self.segments;
            let last = segments.last().map_or(0, |segment| u64::from(segment.pass) + 1);
            beads.passes = beads.passes.map(|_| last);
        }
        self.named = options.identity.then_some(segments);
        clock.lap("sort");
        Ok((solids, sorted))
    }

    fn complete(
        mut self,
        solids: Solids,
        task: &mut Task,
        clock: &mut Clock,
        BuildContext { progress, .. }: BuildContext<'_>,
    ) -> Result<InputSummary> {
        if let Some(segments) = self.named.take() {
            let mut tables = tables(self.sources, &solids)?;
            if self.count == Count::Passes {
                tables.passes = first_passes(&self.counted());
            }
            task.writer.begin_identity(tables);
            let leaves = ListedNodes::of(task.writer.nodes(), task.meta.shard.as_ref());
            let named = ListSources { solids: &solids, paths: &self.paths, count: self.count };
            let written = write_identity(&named, segments, &leaves, &mut task.writer, progress);
            task.keep(written)?;
            clock.lap("identity");
        }
        Ok(InputSummary::Beads(BeadsSummary { segments: self.segments }))
    }
}

impl SolidsSource<'_> {
    /// The paths with their passes.
    fn counted(&self) -> Vec<(&Toolpath, &Passes)> {
        self.paths.iter().copied().zip(&self.passes).collect()
    }
}

/// The number of each bead's first pass, and of all passes.
pub(super) fn first_passes(paths: &[(&Toolpath, &Passes)]) -> Vec<u32> {
    let of_path = |(path, passes): &(&Toolpath, &Passes)| {
        (0..path.len()).map(|bead| passes.starts(bead).len() as u32 + 1).collect::<Vec<u32>>()
    };
    // The segments have been numbered, so there are no more than 32 bits count.
    let add = |sum: &mut u32, passes: u32| Some(std::mem::replace(sum, *sum + passes));
    let counts = paths.iter().flat_map(of_path).chain(std::iter::once(0));
    counts.scan(0, add).collect()
}

/// The root cube and the deepest level, never in step with the layers.
pub(super) fn place_beads(
    first: Option<&Path>,
    bounds: ([f64; 3], [f64; 3]),
    resolution: Resolution,
    sizes: Option<&BeadSizes>,
) -> Result<(RootCube, u8)> {
    let Some(sizes) = sizes else { return place(first, bounds.0, bounds.1, resolution) };
    place_by(first, bounds, resolution, |resolution| match resolution {
        Resolution::Auto => RootCube::with_cell(bounds.0, bounds.1, sizes.cell()),
        Resolution::Depth(depth) => with_depth(bounds, depth, sizes),
        Resolution::Cell(cell) => with_cell(bounds, cell, sizes),
        Resolution::Like(root, depth) => Some((root, depth)),
    })
}

/// What the store says of beads. The names of features are those of all sources, one after the other.
pub(super) fn tables(sources: &[BeadSource<'_>], solids: &Solids) -> Result<BeadTables> {
    let section =
        |p: &SolidProfile| SectionRow { half_width: p.half_width, half_height: p.half_height, axis: p.axis };
    let mut tables =
        BeadTables { sections: solids.profiles().iter().map(section).collect(), ..BeadTables::default() };
    for (number, BeadSource { toolpath, features, .. }) in sources.iter().enumerate() {
        let first = tables.features.len();
        tables.features.extend_from_slice(features);
        for bead in 0..toolpath.len() {
            let Attributes { layer, tool, feature, lines, .. } = *toolpath.attributes(bead);
            let at = first + usize::from(feature);
            let feature = u16::try_from(at).ok().filter(|_| at < tables.features.len()).ok_or_else(|| {
                Error::setting("the toolpaths have too many kinds of features", "build them separately")
            })?;
            tables.beads.push(BeadRow { source: number as u32, layer, tool, feature, lines });
        }
    }
    Ok(tables)
}

/// The toolpaths of inputs.
///
/// # Errors
/// [`Error::Input`] if one of them is a mesh.
pub fn bead_sources(inputs: &[Input]) -> Result<Vec<BeadSource<'_>>> {
    inputs.iter().map(bead_source).collect()
}

fn bead_source(input: &Input) -> Result<BeadSource<'_>> {
    let Some(beads) = input.beads() else {
        let what = "is a mesh, which has no beads";
        return Err(Error::input(input.path(), input.describe(), what, "build from triangles instead"));
    };
    // No facet is made of the beads.
    let source = Source { facets: 0, ..describe(input, input.identity()?) };
    let features = beads.report.features.iter().map(|feature| feature.name.clone()).collect();
    Ok(BeadSource { toolpath: beads.swept.toolpath(), source, features })
}

/// The box around all beads, in world coordinates.
///
/// # Errors
/// [`Error::Input`] if a toolpath has no beads, or one that is not finite.
pub fn bounds_of_sources(sources: &[BeadSource<'_>], outline: Outline) -> Result<([f64; 3], [f64; 3])> {
    let mut all = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for BeadSource { toolpath, source, .. } in sources {
        let path = Path::new(&source.path);
        let (min, max) = bounds_of_beads(toolpath, outline).map_err(|bead| {
            Error::input(
                path,
                format!("line {}", toolpath.attributes(bead).lines.0),
                "a bead has a position or a section that is not finite",
                "correct the line",
            )
        })?;
        // The box around nothing is inside out.
        if min[0] > max[0] {
            let remedy = "give a toolpath that deposits something";
            return Err(Error::input(path, &source.format, "has no beads", remedy));
        }
        for a in 0..3 {
            all.0[a] = all.0[a].min(min[a]);
            all.1[a] = all.1[a].max(max[a]);
        }
    }
    Ok(all)
}
