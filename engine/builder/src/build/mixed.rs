//! The main job from meshes and point clouds together: their winding numbers add up.

use super::clock::Clock;
use super::cloud_inputs::CloudInputs;
use super::cost::{weigh_pieces, weigh_soup};
use super::forecast::{ForecastInput, foresee};
use super::mesh_inputs::{MeshInputs, describe, require_room_for_facets, survey_all};
use super::mixed_field::MixedPiece;
use super::open::OpenSoup;
use super::options::{BuildOptions, Resolution};
use super::pipeline::{BuildContext, BuildSource, build_from};
use super::place::{AUTO_DEPTH, place};
use super::rules::require_no_tolerance;
use super::scope::sort_cubes;
use super::sorted::SortedPieces;
use super::summary::{BuildSummary, InputSummary};
use super::task::Task;
use crate::error::{Error, Result};
use crate::ingest::{CloudInput, Facets, Input, Survey};
use crate::lattice::{MAX_LEVEL, RootCube, Triangle};
use crate::progress::Progress;
use crate::store::Source;
use crate::winding::{CloudPiece, MixedField, OpenPart, OpenSummary, Surfels};
use std::path::Path;

/// What has no tolerance, and does not know what hides between its samples.
pub(super) const MIXED: &str = "of point clouds beside them";

/// One of several inputs.
#[derive(Debug)]
pub enum MixedInput {
    /// A mesh, or a toolpath that is swept to triangles.
    Mesh(Input),
    /// A point cloud.
    Cloud(CloudInput),
}

/// Inputs by their kind.
pub(super) struct SortedInputs {
    pub meshes: Vec<Input>,
    pub clouds: Vec<CloudInput>,
    /// Of each in the order in which they were given, whether it is a cloud.
    are_clouds: Vec<bool>,
}

/// Where meshes and clouds lie.
pub(super) struct MixedPlace {
    /// The box around facets and points.
    pub bounds: ([f64; 3], [f64; 3]),
    pub root: RootCube,
    pub depth: u8,
}

impl SortedInputs {
    /// # Errors
    /// [`Error::Setting`] unless there are both.
    pub fn of(inputs: Vec<MixedInput>) -> Result<SortedInputs> {
        let mut sorted = SortedInputs { meshes: Vec::new(), clouds: Vec::new(), are_clouds: Vec::new() };
        for input in inputs {
            sorted.are_clouds.push(matches!(input, MixedInput::Cloud(_)));
            match input {
                MixedInput::Mesh(mesh) => sorted.meshes.push(mesh),
                MixedInput::Cloud(cloud) => sorted.clouds.push(cloud),
            }
        }
        match sorted.meshes.is_empty() || sorted.clouds.is_empty() {
            true => Err(Error::setting("there are not both meshes and clouds", "give one of each at least")),
            false => Ok(sorted),
        }
    }
}

impl MixedPlace {
    /// The root cube around all, and the deepest level: if none is asked for, the deeper one of what meshes get alone, and
    /// of that whose cells are about half as large as points are apart.
    pub fn of(
        surveys: &[Survey],
        surfels: &Surfels,
        first: Option<&Path>,
        resolution: Resolution,
    ) -> Result<MixedPlace> {
        let of_meshes = Survey::bounds_of_all(surveys);
        let (min, max) = around(of_meshes, surfels.bounds());
        let (root, depth) = match resolution {
            Resolution::Auto => {
                let (root, _) = place(first, min, max, Resolution::Depth(0))?;
                (root, AUTO_DEPTH.max(depth_of_spacing(root, surfels.spacing)))
            }
            asked => place(first, min, max, asked)?,
        };
        Ok(MixedPlace { bounds: around(of_meshes, surfels.points), root, depth })
    }
}

/// The depth whose cells are nearest to half a spacing. Crossings beside meshes come from the samples, which tell them no
/// nearer in larger cells.
fn depth_of_spacing(root: RootCube, spacing: f64) -> u8 {
    // Nearest as a ratio: a cell of twice the next level's is as far off as one of that.
    let is_fine = |level: &u8| 2.0 * root.spacing(*level) <= std::f64::consts::SQRT_2 * spacing;
    (0..MAX_LEVEL).find(is_fine).unwrap_or(MAX_LEVEL)
}

/// The box around two.
fn around(a: ([f64; 3], [f64; 3]), b: ([f64; 3], [f64; 3])) -> ([f64; 3], [f64; 3]) {
    (std::array::from_fn(|i| a.0[i].min(b.0[i])), std::array::from_fn(|i| a.1[i].max(b.1[i])))
}

/// The facets, the caps of the field and its balls, for a tree whose nodes decide from the root on.
pub(super) fn gather(
    field: &MixedField,
    facets: &[Triangle],
    balls: &[CloudPiece],
) -> SortedPieces<MixedField> {
    let caps = field.open().map_or(&[][..], |open| &open.part().caps);
    let triangles = facets.iter().chain(caps).map(|t| MixedPiece::Facet(*t));
    let pieces: Vec<MixedPiece> = triangles.chain(balls.iter().map(|ball| MixedPiece::Ball(*ball))).collect();
    SortedPieces::of_all(field, &pieces)
}

/// Builds `output` from meshes and point clouds together, on the threads of the current rayon pool: the sum of the field of
/// [`super::build_opened`] and that of [`super::build_clouds`], with samples that are off by at most the options'
/// `gwn_error`. With `estimate`, normals are found from the points.
///
/// The file's bytes depend on the inputs, their paths as given, the order of the paths and the options, and on nothing else.
///
/// # Errors
/// As [`super::build_opened`] and [`super::build_clouds`]; if there are only meshes, or only clouds.
pub fn build_mixed(
    inputs: Vec<MixedInput>,
    estimate: bool,
    output: &Path,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<BuildSummary> {
    require_no_tolerance(options.tolerance, MIXED)?;
    options.thin.require_none(MIXED)?;
    let mut inputs = SortedInputs::of(inputs)?;
    let clouds = CloudInputs::given(std::mem::take(&mut inputs.clouds), estimate);
    let source =
        MixedSource { meshes: MeshInputs::given(&inputs.meshes), are_clouds: &inputs.are_clouds, clouds };
    build_from(source, BuildContext { output, options, progress })
}

/// Meshes and clouds as what a store is built from.
struct MixedSource<'a> {
    meshes: MeshInputs<'a>,
    /// See [`SortedInputs`].
    are_clouds: &'a [bool],
    clouds: CloudInputs,
}

impl BuildSource for MixedSource<'_> {
    type Field = MixedField;

    fn begin(&mut self, BuildContext { output, options, progress }: BuildContext<'_>) -> Result<Task> {
        let meshes = self.meshes.opened;
        let surveys = survey_all(meshes, progress)?;
        let sources = self.sources(&surveys)?;
        let surfels = self.clouds.measure(options.resources.memory, progress)?;
        let first = meshes.first().map(Input::path);
        let MixedPlace { bounds, root, depth } =
            MixedPlace::of(&surveys, surfels, first, options.resolution)?;
        let alone = ("meshes beside clouds stay in memory", "build them apart");
        require_room_for_facets(self.meshes.facets(), &options.resources, alone)?;
        foresee(&ForecastInput::Facets(meshes), (root, depth), bounds, output, options, progress)?;
        let mut task = Task::begin(sources, bounds, root, depth, output, options, None)?;
        task.rules.evaluate_interior = true;
        Ok(task)
    }

    fn sort(
        &mut self,
        task: &mut Task,
        clock: &mut Clock,
        BuildContext { options, progress, .. }: BuildContext<'_>,
    ) -> Result<(MixedField, SortedPieces<MixedField>)> {
        let root = task.meta.root;
        self.meshes.turn(root, options, progress)?;
        let meshes = &self.meshes;
        clock.lap_if(meshes.are_turned(), "orient");
        let cubes = (sort_cubes(&task.rules), task.rules.sieved());
        let soup = meshes.snapped(root, cubes, &task.room, progress)?;
        task.meta.numbers.facets = meshes.facets() + self.clouds.summary.points;
        task.meta.numbers.degenerate_facets = soup.degenerate + self.clouds.summary.void_points;
        clock.lap("snap");
        let mut triangles = Vec::new();
        soup.sorted.gather(0, &mut triangles)?;
        drop(soup.sorted);
        let memory = task.room.memory() / 4;
        let close = |soups: &[&dyn Facets]| OpenPart::within(memory, soups, root, progress);
        let open = (!soup.balance.is_closed()).then(|| meshes.with_soups(close)).transpose()?;
        meshes.check()?;
        let field = MixedField::new(self.clouds.take(), open, root, options.gwn_error, task.rules.depth)?;
        if let Some(open) = field.open() {
            task.room.take(OpenSoup::require_room(open, task.room.memory())?);
        }
        clock.lap("cluster");
        let balls: Vec<CloudPiece> = field.cloud().pieces().collect();
        let weigh = |cubes| {
            let of_facets = meshes.with_soups(|soups| weigh_soup(soups, root, cubes, progress))?;
            Ok(of_facets.and(&weigh_pieces(field.cloud(), &field.cloud().numbers(), cubes, progress)?))
        };
        task.cut(weigh, 0)?;
        clock.lap_if(task.meta.shard.is_some(), "weigh");
        let sorted = gather(&field, &triangles, &balls);
        Ok((field, sorted))
    }

    fn complete(
        self,
        field: MixedField,
        task: &mut Task,
        _: &mut Clock,
        _: BuildContext<'_>,
    ) -> Result<InputSummary> {
        let open = field.open().map_or(OpenSummary::default(), |open| open.part().summary);
        let degenerate = task.meta.numbers.degenerate_facets - self.clouds.summary.void_points;
        Ok(InputSummary::Mixed(self.meshes.summary(degenerate, open, None), self.clouds.summary))
    }
}

impl MixedSource<'_> {
    /// What the store records, in the order in which inputs were given.
    fn sources(&self, surveys: &[Survey]) -> Result<Vec<Source>> {
        let mut meshes = self.meshes.opened.iter().zip(surveys);
        let mut clouds = self.clouds.sources();
        let source = |is_cloud: &bool| match is_cloud {
            true => clouds.next().expect("as many as there are"),
            false => {
                let (input, survey) = meshes.next().expect("as many as there are");
                Ok(describe(input, survey.identity))
            }
        };
        self.are_clouds.iter().map(source).collect()
    }
}
