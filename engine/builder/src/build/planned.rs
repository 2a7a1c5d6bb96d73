//! Shards without reading the input once for each: one machine makes a plan, the others build from that.

use super::clock::Clock;
use super::cost::weigh_soup;
use super::mesh_inputs::MeshInputs;
use super::meshes::{MeasuredSoup, measure_soup};
use super::options::{BuildOptions, CommitOptions};
use super::pipeline::{BuildContext, BuildSource, build_from};
use super::plan_file::{PlanDirectory, PlanFile, write_plan};
use super::rebuild::without_wrong_device;
use super::resources::SpillResources;
use super::rules::Rules;
use super::scope::{job_level, sort_cubes};
use super::sorted::SortedPieces;
use super::soup::Soup;
use super::summary::{BuildSummary, FacetsSummary, InputSummary};
use super::task::{Task, meta_of, way_to_turn};
use crate::error::{Error, Result};
use crate::ingest::Input;
use crate::lattice::NodeKey;
use crate::progress::Progress;
use crate::store::{BuildCounts, Meta, Shard, ShardId, ShardNumbers, check_target};
use crate::volumes::facet_volumes;
use crate::winding::CornerGrid;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;

/// What making a plan has found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlanSummary {
    /// Facets read.
    pub facets: u64,
    /// Facets without area on the lattice.
    pub degenerate_facets: u64,
    /// Deepest level of the tree.
    pub depth: u8,
    /// Cell edge at the deepest level, in the input's unit.
    pub cell: f64,
    /// Cubes that have work, of which shards get runs.
    pub cubes: u64,
    /// Size of the plan.
    pub file_bytes: u64,
    /// Bytes written to the temporary file; 0 if the triangles fitted in memory.
    pub temporary_bytes: u64,
    /// Seconds by phase, in order.
    pub phases: Vec<(&'static str, f64)>,
}

/// Makes a plan of closed meshes: reads them once, and writes what all shards of their store need. The plan itself may have
/// other bytes each time; the shards that are built from it do not.
///
/// # Errors
/// As [`super::build_opened`]; and if the surface is open, since then every sample depends on all facets.
pub fn plan(
    opened: &[Input],
    output: &Path,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<PlanSummary> {
    let mut clock = Clock::default();
    check_target(output)?;
    let MeasuredSoup { bounds, root, depth, sources } = measure_soup(opened, options.resolution, progress)?;
    let mut meta = meta_of(sources, bounds, (root, depth), options)?;
    let rules = Rules::of(&meta)?;
    require_following(&rules)?;
    let room = SpillResources::new(&options.resources, output)?;
    clock.lap("measure");
    let mut inputs = MeshInputs::given(opened);
    inputs.turn(root, options, progress)?;
    clock.lap_if(inputs.are_turned(), "orient");
    let level = job_level(&rules);
    let cost = inputs.with_soups(|soups| weigh_soup(soups, root, (level, rules.depth), progress))?;
    clock.lap("weigh");
    let facets = inputs.facets();
    let cubes = sort_cubes(&rules);
    let soup = inputs.snapped(root, (cubes, rules.sieved()), &room, progress)?;
    require_closed(soup.balance.is_closed())?;
    clock.lap("snap");
    meta.volumes = inputs.with_soups(|soups| facet_volumes(soups, bounds, room.memory() / 8, progress))?;
    clock.lap("volumes");
    meta.numbers.facets = facets;
    meta.numbers.degenerate_facets = soup.degenerate;
    let found = ShardNumbers { pieces: cost.sum, ..ShardNumbers::default() };
    let one = ShardId { number: 1, of: 1 };
    meta.shard = Some(Shard { id: one, level, gwn_error: options.gwn_error, found });
    let (way, settings) = (way_to_turn(options), options.keeping.settings.clone());
    let jumps = soup.sorted.corners.iter().flat_map(CornerGrid::jumps).collect();
    let directory = PlanDirectory { meta, way, settings, work: cost.of_cubes(), jumps };
    let file_bytes = write_plan(output, &directory, (&soup.sorted, cubes.cells()), progress)?;
    clock.lap("write");
    Ok(PlanSummary {
        facets,
        degenerate_facets: soup.degenerate,
        depth: directory.meta.depth,
        cell: root.spacing(directory.meta.depth),
        cubes: directory.work.iter().filter(|&&work| work > 0).count() as u64,
        file_bytes,
        temporary_bytes: room.file().bytes(),
        phases: clock.laps,
    })
}

fn require_following(rules: &Rules) -> Result<()> {
    if rules.refines_all_touched() {
        return Ok(());
    }
    let what =
        "nodes decide whether they are divided, so every shard holds all facets, and a plan saves nothing";
    Err(Error::setting(what, "build the shards from the input itself"))
}

fn require_closed(is_closed: bool) -> Result<()> {
    if is_closed {
        return Ok(());
    }
    let what = "the surface is open, so every sample depends on all facets, and a plan saves nothing";
    Err(Error::setting(what, "build the shards from the input itself, or close the surface"))
}

/// Builds the shard of a plan that `options.shard` names, on the threads of the current rayon pool. Of the other options only
/// resources, what is kept of an interrupted build, and the program count; all else is the plan's.
///
/// The shard is joined with the others of its plan by [`super::merge`], to the bytes of one build.
///
/// # Errors
/// A plan that is damaged or was made by another version of the program, no shard, an output that cannot be written.
pub fn build_planned(
    plan: &Path,
    output: &Path,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<BuildSummary> {
    let plan = Arc::new(PlanFile::open(plan)?);
    let Some(planned) = &plan.directory.meta.shard else {
        return Err(plan.damaged("no cubes are shared out"));
    };
    // What decides the tree is the plan's.
    let keeping = CommitOptions { settings: plan.directory.settings.clone(), ..options.keeping.clone() };
    let options = BuildOptions { keeping, gwn_error: planned.gwn_error, ..options.clone() };
    without_wrong_device(&options, |options| {
        let source = PlannedShard { plan: Arc::clone(&plan), pieces: planned.found.pieces };
        build_from(source, BuildContext { output, options, progress })
    })
}

/// A shard of a plan as what a store is built from.
struct PlannedShard {
    plan: Arc<PlanFile>,
    /// The sum over all of its pieces.
    pieces: u64,
}

impl BuildSource for PlannedShard {
    type Field = Soup;

    fn begin(&mut self, BuildContext { output, options, .. }: BuildContext<'_>) -> Result<Task> {
        let PlanDirectory { meta, way, .. } = &self.plan.directory;
        if meta.program != options.program {
            return Err(self.plan.of_other_version(&options.program));
        }
        let Some(id) = options.shard else {
            return Err(Error::setting("a plan is built in shards", "say which with `shard`"));
        };
        let is_first = id.number == 1;
        let volumes = meta.volumes.clone().filter(|_| is_first);
        let whole = Meta { shard: None, volumes: None, ..meta.clone() };
        let mut task = Task::begin_as(whole, (options.gwn_error, way.clone()), output, options)?;
        task.meta.volumes = volumes;
        require_following(&task.rules)?;
        Ok(task)
    }

    fn sort(
        &mut self,
        task: &mut Task,
        clock: &mut Clock,
        BuildContext { options, .. }: BuildContext<'_>,
    ) -> Result<(Soup, SortedPieces<Soup>)> {
        let PlanDirectory { work, jumps, .. } = &self.plan.directory;
        if work.len() != 1 << (3 * u32::from(job_level(&task.rules))) {
            return Err(self.plan.damaged("it has other cubes than the tree"));
        }
        task.cut_by(work, 0, self.pieces);
        let corners = CornerGrid::from_jumps(NodeKey::ROOT, sort_cubes(&task.rules).stride(), jumps);
        let corners = corners.ok_or_else(|| self.plan.damaged("it has other corners than the tree"))?;
        let triangles = self.plan.triangles(task.cubes().kept(), task.room.file());
        let sorted = SortedPieces::kept_elsewhere(corners, Box::new(triangles));
        clock.lap("open plan");
        Ok((Soup { device: options.resources.device.clone(), open: None }, sorted))
    }

    fn complete(self, _: Soup, task: &mut Task, _: &mut Clock, _: BuildContext<'_>) -> Result<InputSummary> {
        self.plan.check()?;
        let BuildCounts { facets, degenerate_facets, .. } = task.meta.numbers;
        let read = FacetsSummary { facets, degenerate_facets, ..FacetsSummary::default() };
        Ok(InputSummary::Facets(read))
    }
}
