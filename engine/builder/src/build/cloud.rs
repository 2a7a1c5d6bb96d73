//! The main job from point clouds: points in, store out.

use super::clock::Clock;
use super::cloud_inputs::CloudInputs;
use super::cost::weigh_pieces;
use super::field::{BrickEvaluation, Fractions, PieceField, PieceList};
use super::options::{BuildOptions, Resolution};
use super::pipeline::{BuildContext, BuildSource, build_from};
use super::place::place;
use super::rules::{POINTS, require_no_tolerance};
use super::sorted::SortedPieces;
use super::summary::{BuildSummary, InputSummary};
use super::task::Task;
use crate::brick::{Brick, Samples};
use crate::error::Result;
use crate::ingest::CloudInput;
use crate::lattice::{MAX_LEVEL, NodeKey, RootCube, Units};
use crate::progress::Progress;
use crate::store::Refine;
use crate::winding::{CloudBrick, CloudBricks, CloudEvaluator, Surfels};
use std::path::{Path, PathBuf};

impl PieceField for CloudBricks {
    /// Its number, which takes a quarter of what a ball does.
    type Piece = u32;
    type Corners = ();
    type Evaluator = CloudEvaluator;
    type Evaluation<'a> = CloudBrick<'a>;

    fn bounds(&self, piece: &u32) -> (Units, Units) {
        self.piece(*piece).bounds()
    }

    fn points(&self, piece: &u32) -> [Units; 3] {
        [self.piece(*piece).position; 3]
    }

    fn cube_test(&self, piece: &u32, size: i32) -> impl Fn(Units) -> bool {
        let piece = self.piece(*piece);
        move |low| piece.touches_cube(low, size)
    }

    fn is_void(&self, _: &u32) -> bool {
        false
    }

    fn corners(&self, _: NodeKey, _: u8) {}

    fn add_corners(&self, (): &mut (), _: &u32) {}

    fn merge_corners(&self, (): &mut (), (): &()) {}

    fn finish_corners(&self, (): (), _: i64) -> Vec<i64> {
        Vec::new()
    }

    /// The field changes everywhere.
    fn settled(&self, _: NodeKey, _: i16, _: PieceList<'_, u32>) -> Option<i16> {
        None
    }

    /// A node that holds a ball too small for its samples has hidden crossings.
    fn refined_unseen(
        &self,
        refine: Refine,
        key: NodeKey,
        _: i16,
        list: PieceList<'_, u32>,
    ) -> Option<[i16; 8]> {
        let is_hidden = |&i: &u32| !self.piece(list.array[i as usize]).is_seen_by(key);
        (refine == Refine::Hidden && list.indices.iter().any(is_hidden)).then_some([0; 8])
    }

    fn evaluate<'a>(
        &'a self,
        evaluator: &'a mut CloudEvaluator,
        key: NodeKey,
        _: i16,
        list: PieceList<'a, u32>,
    ) -> Result<CloudBrick<'a>> {
        let pieces = list.indices.iter().map(|&i| self.piece(list.array[i as usize]));
        CloudBricks::evaluate(self, evaluator, key, pieces)
    }
}

impl BrickEvaluation for CloudBrick<'_> {
    fn samples(&self) -> &Samples {
        CloudBrick::samples(self)
    }

    fn into_samples(self) -> Samples {
        CloudBrick::into_samples(self)
    }

    fn has_hidden_crossings(&mut self) -> bool {
        self.has_details()
    }

    fn has_hidden_boundary(&mut self) -> bool {
        self.has_details()
    }

    fn into_leaf(self) -> Result<Brick> {
        Ok(CloudBrick::into_leaf(self))
    }

    fn fractions(&self) -> Option<Fractions> {
        Some(Fractions { bits: self.samples().1, straight: self.is_straight() })
    }
}

/// Builds `output` from the points of all inputs together, on the threads of the current rayon pool: the field of
/// [`crate::winding::CloudField`], with samples that are off by at most the options' `gwn_error`. With `estimate`,
/// normals are those of [`crate::winding::estimate_normals`], whatever the inputs say.
///
/// The file's bytes depend on the inputs, their paths as given, the order of the paths and the options. They do not
/// depend on the threads, nor, but for the inputs' hashes in the metadata, on the order of points that do not
/// coincide.
///
/// # Errors
/// Points without normals or without area, settings that do not fit them, an output that cannot be written. Nothing
/// is left under the final name unless the build succeeds.
pub fn build_clouds(
    inputs: Vec<CloudInput>,
    estimate: bool,
    output: &Path,
    options: &BuildOptions,
    progress: &dyn Progress,
) -> Result<BuildSummary> {
    require_no_tolerance(options.tolerance, POINTS)?;
    options.thin.require_none(POINTS)?;
    let first = inputs.first().map(|input| input.path().to_owned());
    let source = CloudSource { inputs: CloudInputs::given(inputs, estimate), first };
    build_from(source, BuildContext { output, options, progress })
}

/// Point clouds as what a store is built from.
struct CloudSource {
    inputs: CloudInputs,
    /// The first file, for messages.
    first: Option<PathBuf>,
}

impl BuildSource for CloudSource {
    type Field = CloudBricks;

    fn begin(&mut self, BuildContext { output, options, progress }: BuildContext<'_>) -> Result<Task> {
        let sources = self.inputs.sources().collect::<Result<_>>()?;
        let surfels = self.inputs.measure(options.resources.memory, progress)?;
        let (root, depth) = place_cloud(surfels, self.first.as_deref(), options.resolution)?;
        let mut task = Task::begin(sources, surfels.points, root, depth, output, options, None)?;
        task.rules.evaluate_interior = true;
        task.meta.numbers.facets = self.inputs.summary.points;
        task.meta.numbers.degenerate_facets = self.inputs.summary.void_points;
        Ok(task)
    }

    fn sort(
        &mut self,
        task: &mut Task,
        clock: &mut Clock,
        BuildContext { options, progress, .. }: BuildContext<'_>,
    ) -> Result<(CloudBricks, SortedPieces<CloudBricks>)> {
        let root = task.meta.root;
        let field = CloudBricks::new(self.inputs.take(), root, options.gwn_error, task.rules.depth)?;
        clock.lap("cluster");
        let numbers = field.numbers();
        task.cut(|cubes| weigh_pieces(&field, &numbers, cubes, progress), 0)?;
        clock.lap_if(task.meta.shard.is_some(), "weigh");
        let sorted = SortedPieces::of_all(&field, &numbers);
        Ok((field, sorted))
    }

    fn complete(
        self,
        _: CloudBricks,
        _: &mut Task,
        _: &mut Clock,
        _: BuildContext<'_>,
    ) -> Result<InputSummary> {
        Ok(InputSummary::Points(self.inputs.summary))
    }
}

/// The root cube and the deepest level: if none is asked for, the first whose cells are no larger than points are apart.
/// Finer cells would show how single points are spread: crossings are roots of the sum, however far apart samples are.
pub(super) fn place_cloud(
    surfels: &Surfels,
    first: Option<&Path>,
    resolution: Resolution,
) -> Result<(RootCube, u8)> {
    let (min, max) = surfels.bounds();
    if resolution != Resolution::Auto {
        return place(first, min, max, resolution);
    }
    let (root, _) = place(first, min, max, Resolution::Depth(0))?;
    Ok((root, depth_of_spacing(root, surfels.spacing)))
}

/// The depth from which on cells are no larger than a spacing.
fn depth_of_spacing(root: RootCube, spacing: f64) -> u8 {
    (0..MAX_LEVEL).find(|level| root.spacing(*level) <= spacing).unwrap_or(MAX_LEVEL)
}

/// The cells of a build without --depth and --cell: their size, and the level that has them.
///
/// # Errors
/// If the points span no box that a lattice fits.
pub fn cloud_cells(surfels: &Surfels) -> Result<(f64, u8)> {
    let (root, depth) = place_cloud(surfels, None, Resolution::Auto)?;
    Ok((root.spacing(depth), depth))
}
