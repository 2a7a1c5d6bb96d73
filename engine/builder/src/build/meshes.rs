//! The main job from mesh files, and from toolpaths swept to triangles.

use super::clock::Clock;
use super::cost::weigh_soup;
use super::forecast::{ForecastInput, foresee};
use super::mesh_inputs::{MeshInputs, describe, require_room_for_facets, survey_all};
use super::open::OpenSoup;
use super::options::{BuildOptions, Resolution};
use super::pipeline::{BuildContext, BuildSource, build_from};
use super::place::place;
use super::rebuild::without_wrong_device;
use super::rules::{OPEN, require_no_tolerance};
use super::snap::SnappedSoup;
use super::sorted::SortedPieces;
use super::soup::Soup;
use super::summary::{BuildSummary, InputSummary};
use super::task::Task;
use super::toolpaths::{bead_sources, build_beads};
use crate::error::Result;
use crate::ingest::{Input, Survey};
use crate::lattice::RootCube;
use crate::progress::Progress;
use crate::store::Source;
use crate::volumes::facet_volumes;
use crate::winding::OpenSummary;
use std::path::{Path, PathBuf};

/// Facets whose volumes cost what one more facet in a cube does. Measured on 10 million.
const FACETS_OF_VOLUMES: u64 = 2;

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
    without_wrong_device(options, |options| {
        build_from(
            MeshSource { inputs: MeshInputs::given(opened) },
            BuildContext { output, options, progress },
        )
    })
}

/// Mesh files as what a store is built from.
struct MeshSource<'a> {
    inputs: MeshInputs<'a>,
}

impl BuildSource for MeshSource<'_> {
    type Field = Soup;

    fn begin(&mut self, BuildContext { output, options, progress }: BuildContext<'_>) -> Result<Task> {
        let opened = self.inputs.opened;
        let MeasuredSoup { bounds, root, depth, sources } =
            measure_soup(opened, options.resolution, progress)?;
        foresee(&ForecastInput::Facets(opened), (root, depth), bounds, output, options, progress)?;
        Task::begin(sources, bounds, root, depth, output, options, None)
    }

    fn sort(
        &mut self,
        task: &mut Task,
        clock: &mut Clock,
        context: BuildContext<'_>,
    ) -> Result<(Soup, SortedPieces<Soup>)> {
        let BuildContext { options, progress, .. } = context;
        let root = task.meta.root;
        self.inputs.turn(root, options, progress)?;
        clock.lap_if(self.inputs.are_turned(), "orient");
        let facets = self.inputs.facets();
        let weigh = |cubes| self.inputs.with_soups(|soups| weigh_soup(soups, root, cubes, progress));
        task.cut(weigh, facets / FACETS_OF_VOLUMES)?;
        clock.lap_if(task.meta.shard.is_some(), "weigh");
        let soup = self.inputs.snapped(root, (task.cubes(), task.rules.sieved()), &task.room, progress)?;
        task.meta.numbers.facets = facets;
        task.meta.numbers.degenerate_facets = soup.degenerate;
        clock.lap("snap");
        if soup.balance.is_closed() {
            return Ok((Soup { device: options.resources.device.clone(), open: None }, soup.sorted));
        }
        let closed = self.close(soup, task, context)?;
        clock.lap("close");
        Ok(closed)
    }

    fn complete(
        self,
        field: Soup,
        task: &mut Task,
        clock: &mut Clock,
        BuildContext { progress, .. }: BuildContext<'_>,
    ) -> Result<InputSummary> {
        if field.open.is_none() && task.measures_volumes() {
            let bounds = (task.meta.bounds_min, task.meta.bounds_max);
            let memory = task.room.memory() / 8;
            let volumes = self.inputs.with_soups(|soups| facet_volumes(soups, bounds, memory, progress));
            task.meta.volumes = task.keep(volumes)?;
            clock.lap("volumes");
        }
        let inside_out = self.inputs.with_soups(|soups| task.find_inside_out(soups, progress))?;
        clock.lap_if(inside_out.is_some(), "pieces");
        let degenerate = task.meta.numbers.degenerate_facets;
        let open = field.open.map_or(OpenSummary::default(), |open| open.field.part().summary);
        Ok(InputSummary::Facets(self.inputs.summary(degenerate, open, inside_out)))
    }
}

impl MeshSource<'_> {
    /// An open soup, its holes closed by caps whose part is taken off again.
    fn close(
        &self,
        soup: SnappedSoup,
        task: &mut Task,
        BuildContext { options, progress, .. }: BuildContext<'_>,
    ) -> Result<(Soup, SortedPieces<Soup>)> {
        require_no_tolerance(options.tolerance, OPEN)?;
        options.thin.require_none(OPEN)?;
        if !task.rules.refines_all_touched() {
            let open = ("the surface is open", "close the surface");
            require_room_for_facets(task.meta.numbers.facets, &options.resources, open)?;
            task.rules.evaluate_interior = true;
        }
        let mut sorted = soup.sorted;
        let (root, memory) = (task.meta.root, task.room.memory());
        let (accuracy, device) = ((options.gwn_error, task.rules.depth), options.resources.device.as_ref());
        let open = self
            .inputs
            .with_soups(|soups| OpenSoup::close(soups, root, accuracy, (memory, device), progress))?;
        self.inputs.check()?;
        task.room.take(open.bytes());
        sorted.push(&Soup::CPU, &task.cubes(), open.caps());
        Ok((Soup { device: None, open: Some(open) }, sorted))
    }
}

/// Meshes that have been measured: where they lie, and what they are.
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
    let surveys = survey_all(opened, progress)?;
    let bounds = Survey::bounds_of_all(&surveys);
    let (root, depth) = place(opened.first().map(Input::path), bounds.0, bounds.1, resolution)?;
    let sources =
        opened.iter().zip(&surveys).map(|(input, survey)| describe(input, survey.identity)).collect();
    Ok(MeasuredSoup { bounds, root, depth, sources })
}
