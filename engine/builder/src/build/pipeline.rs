//! The main job, whatever the input is made of: measure it, begin the store, sort its pieces, build the tree, finish.

use super::clock::Clock;
use super::field::PieceField;
use super::options::BuildOptions;
use super::sorted::SortedPieces;
use super::summary::{BuildSummary, InputSummary};
use super::task::Task;
use crate::error::Result;
use crate::progress::Progress;
use crate::store::check_target;
use std::path::Path;

/// What a build reads and asks for, beside its input.
#[derive(Clone, Copy)]
pub(super) struct BuildContext<'a> {
    /// The store to be.
    pub output: &'a Path,
    pub options: &'a BuildOptions,
    pub progress: &'a dyn Progress,
}

/// A kind of input. Its methods are called once each, in this order.
pub(super) trait BuildSource {
    /// The field of its pieces.
    type Field: PieceField;

    /// Measures the input, says what the build will take, and begins the store.
    fn begin(&mut self, context: BuildContext<'_>) -> Result<Task>;

    /// Reads the pieces and sorts them by cube; decides which cubes are those of the shard.
    fn sort(
        &mut self,
        task: &mut Task,
        clock: &mut Clock,
        context: BuildContext<'_>,
    ) -> Result<(Self::Field, SortedPieces<Self::Field>)>;

    /// Adds to the store what is no part of the tree, and tells what was read.
    fn complete(
        self,
        field: Self::Field,
        task: &mut Task,
        clock: &mut Clock,
        context: BuildContext<'_>,
    ) -> Result<InputSummary>;
}

/// Builds a store from an input of whatever kind.
pub(super) fn build_from<S: BuildSource>(mut source: S, context: BuildContext<'_>) -> Result<BuildSummary> {
    let mut clock = Clock::default();
    check_target(context.output)?;
    let mut task = source.begin(context)?;
    clock.lap("measure");
    let (field, sorted) = source.sort(&mut task, &mut clock, context)?;
    task.build(&field, sorted, context.progress)?;
    clock.lap("build");
    let read = source.complete(field, &mut task, &mut clock, context)?;
    task.finish(read, clock, context.progress)
}
