//! A build whose input is known and measured: its settings, its store, what it may take.

use super::bins::Binner;
use super::clock::Clock;
use super::cost::CostMap;
use super::field::PieceField;
use super::jobs::build_tree;
use super::options::{BuildOptions, CommitOptions};
use super::partition::cut;
use super::resources::SpillResources;
use super::rules::{Rules, TreeOptions};
use super::scope::{BuildPlan, job_level, sort_cubes};
use super::sorted::SortedPieces;
use super::summary::{BuildSummary, InputSummary, ResumedBuild, ShardSummary};
use super::thin::ThinSummary;
use crate::brick::ThinFeatures;
use crate::error::{Error, Result};
use crate::ingest::Facets;
use crate::lattice::RootCube;
use crate::pieces::{Consistency, InsideOut, study};
use crate::progress::Progress;
use crate::store::{
    BeadsMeta, BuildCounts, Compression, Meta, Records, Shard, ShardNumbers, Source, Stats, StoreWriter,
};
use std::path::Path;
use std::sync::Mutex;

/// The error of an index that takes more than it may, of a store whose nodes so far are kept.
fn outgrown(writer: &mut StoreWriter, index: u64) -> Error {
    if let Err(error) = writer.commit() {
        return error;
    }
    let (part, nodes) = writer.unfinished().unwrap_or_default();
    let kib = index >> 10;
    let what = format!("the index of {nodes} nodes has outgrown the {kib} KiB that it may take");
    Error::store(&part, "index", what, "run the same again with more `memory`, which goes on from there")
}

/// A build whose input is known and measured: the store is begun.
pub(super) struct Task {
    pub rules: Rules,
    pub meta: Meta,
    pub writer: StoreWriter,
    /// Memory and temporary file.
    pub room: SpillResources,
    /// What hides between the samples of the leaves that were built.
    thin: Mutex<ThinFeatures>,
    /// The part of all work that was foreseen for the shard, if only one is asked for.
    work: f64,
    /// What was there when it began.
    resumed: Option<ResumedBuild>,
}

impl Task {
    /// Checks the settings and begins the store.
    pub fn begin(
        sources: Vec<Source>,
        bounds: ([f64; 3], [f64; 3]),
        root: RootCube,
        depth: u8,
        output: &Path,
        options: &BuildOptions,
        beads: Option<BeadsMeta>,
    ) -> Result<Task> {
        let meta = meta_of(sources, bounds, (root, depth), options)?;
        let way = way_to_turn(options);
        Task::begin_as(Meta { beads, ..meta }, (options.gwn_error, way), output, options)
    }

    /// Begins the store that `meta` tells of. Of the options, only those count that are not in it. Samples of open input have
    /// errors up to `gwn_error`; pieces were turned in the `way` that is named.
    pub fn begin_as(
        meta: Meta,
        (gwn_error, way): (f64, String),
        output: &Path,
        options: &BuildOptions,
    ) -> Result<Task> {
        let compression = options.compression;
        if options.shard.is_some() && compression != Compression::Lz4 {
            let what = format!("a shard of a store is not built with the compression {compression}");
            return Err(Error::setting(
                what,
                "leave it out, and repack the whole when the shards are joined",
            ));
        }
        let rules = Rules { compression: Some(compression), ..Rules::of(&meta)? };
        let shard = options.shard.map(|id| Shard {
            id,
            level: job_level(&rules),
            gwn_error,
            found: ShardNumbers::default(),
        });
        let meta = Meta { shard, ..meta };
        let room = SpillResources::new(&options.resources, output)?;
        let CommitOptions { pace, restart, settings } = options.keeping.clone();
        let of_build = [
            ("made by", "build".to_owned()),
            ("error of samples", gwn_error.to_string()),
            ("compression", compression.to_string()),
            ("way to turn pieces", way),
        ];
        let of_build = of_build.into_iter().map(|(name, value)| (name.to_owned(), value));
        let writer = StoreWriter::resume(output, &meta, of_build.chain(settings).collect(), restart, pace)?;
        let resumed =
            writer.kept().map(|kept| ResumedBuild { nodes: kept.nodes(), part: kept.part_of_curve() });
        Ok(Task { rules, meta, writer, room, thin: Mutex::default(), work: 1.0, resumed })
    }

    /// Whether the volumes of the source are to be measured: of shards the first does it for all.
    pub fn measures_volumes(&self) -> bool {
        self.meta.shard.as_ref().is_none_or(|shard| shard.id.number == 1)
    }

    /// Decides which cubes are those of the shard that is asked for, if one is. `weigh` is told their level and the
    /// tree's depth. Measuring the volumes is `other` work.
    pub fn cut(&mut self, weigh: impl FnOnce((u8, u8)) -> Result<CostMap>, other: u64) -> Result<()> {
        let Some(shard) = &self.meta.shard else { return Ok(()) };
        let work = weigh((shard.level, self.rules.depth))?;
        self.cut_by(&work.of_cubes(), other, work.sum);
        Ok(())
    }

    /// The same, given the work of each cube and the sum over all pieces.
    pub fn cut_by(&mut self, of_cubes: &[u64], other: u64, pieces: u64) {
        let Some(shard) = &mut self.meta.shard else { return };
        let cells = cut(shard.id, of_cubes, other);
        let of_shard: u64 = of_cubes[cells.start as usize..cells.end as usize].iter().sum();
        let own = if shard.id.number == 1 { other } else { 0 };
        let all = other + of_cubes.iter().sum::<u64>();
        self.work = (own + of_shard) as f64 / all.max(1) as f64;
        shard.found.cells = (cells.start, cells.end);
        shard.found.pieces = pieces;
    }

    /// The cubes that pieces are to be sorted by.
    pub fn cubes(&self) -> Binner {
        let cubes = sort_cubes(&self.rules);
        match &self.meta.shard {
            Some(shard) if self.rules.refines_all_touched() => cubes.keeping(shard.cells()),
            _ => cubes,
        }
    }

    /// Builds the tree.
    pub fn build<F: PieceField>(
        &mut self,
        field: &F,
        sorted: SortedPieces<F>,
        progress: &dyn Progress,
    ) -> Result<()> {
        if let Some(ResumedBuild { nodes, part }) = &self.resumed {
            let percent = 100.0 * part;
            progress.note(&format!(
                "going on from {nodes} nodes of an earlier run, {percent:.0}% of the way through the tree"
            ));
        }
        let kept = self.writer.kept();
        let shard = self.meta.shard.as_ref();
        let plan = BuildPlan { rules: &self.rules, shard, kept: kept.as_deref(), thin: &self.thin };
        let (writer, index) = (&mut self.writer, self.room.index());
        let mut record = |bricks: Records| {
            let bytes = bricks.write(writer)?;
            writer.commit_if_due()?;
            if bytes > index { Err(outgrown(writer, index)) } else { Ok(bytes) }
        };
        let built = build_tree(field, sorted, plan, self.room.memory(), progress, &mut record);
        let empty = self.keep(built)?;
        if let Some(shard) = &mut self.meta.shard {
            shard.found.joined = self.rules.refines_all_touched();
            shard.found.empty = empty;
        }
        Ok(())
    }

    /// The pieces that are inside out, if a whole tree is negative somewhere; `None` also where there is too little memory to
    /// find them.
    pub fn find_inside_out(
        &mut self,
        soups: &[&dyn Facets],
        progress: &dyn Progress,
    ) -> Result<Option<InsideOut>> {
        let is_negative = self.writer.lowest().is_some_and(|lowest| lowest < 0);
        if !is_negative || self.meta.shard.is_some() {
            return Ok(None);
        }
        let found = match study(soups, self.meta.root, Consistency::Given, self.room.memory(), progress) {
            Ok((report, _)) => Ok(report.inside_out),
            // There is too little memory to find them.
            Err(Error::Setting { .. }) => Ok(None),
            Err(error) => Err(error),
        };
        self.keep(found)
    }

    /// Passes on a result. If the user or the system is why it is an error, what there is so far is kept; if a device is,
    /// nothing of it.
    pub fn keep<T>(&mut self, result: Result<T>) -> Result<T> {
        if matches!(result, Err(Error::Distrusted { .. })) {
            self.writer.give_up();
        }
        let Err(error @ (Error::Interrupted | Error::Io { .. })) = result else { return result };
        // If the store itself can no longer be written, what was committed before is there.
        let committed = self.writer.commit();
        match (error, self.writer.unfinished()) {
            (Error::Interrupted, Some((part, nodes))) if committed.is_ok() => {
                Err(Error::Suspended { part, nodes })
            }
            (error, _) => Err(error),
        }
    }

    /// Completes the store, whose `input` was read.
    pub fn finish(
        self,
        input: InputSummary,
        mut clock: Clock,
        progress: &dyn Progress,
    ) -> Result<BuildSummary> {
        progress.phase("finishing", None, "bytes");
        let Meta { root, depth, .. } = self.meta;
        let shard = self.meta.shard.as_ref().map(|shard| ShardSummary {
            id: shard.id,
            level: shard.level,
            cubes: shard.cells().end - shard.cells().start,
            work: self.work,
        });
        let thin = self.thin.into_inner().expect("no thread panicked");
        let thin = (!thin.is_empty()).then(|| ThinSummary::new(&thin, root, depth));
        let Stats { nodes, leaves, file_bytes, .. } = self.writer.finish(self.meta)?;
        clock.lap("finish");
        Ok(BuildSummary {
            input,
            depth,
            cell: root.spacing(depth),
            nodes,
            leaves,
            file_bytes,
            base_depth: self.rules.depth,
            thin,
            temporary_bytes: self.room.file().bytes(),
            resumed: self.resumed,
            shard,
            device: None,
            phases: clock.laps,
        })
    }
}

/// What is known of a store before it is built.
///
/// # Errors
/// If the settings make no sense, or not together.
pub(super) fn meta_of(
    sources: Vec<Source>,
    (bounds_min, bounds_max): ([f64; 3], [f64; 3]),
    (root, depth): (RootCube, u8),
    options: &BuildOptions,
) -> Result<Meta> {
    let BuildOptions { stddev, tolerance, .. } = *options;
    let (depth, refine) = options.thin.of(depth, options.refine)?;
    // The metadata have no place for numbers that make no sense.
    Rules::new(TreeOptions { depth, refine, stddev, tolerance }, root)?;
    Ok(Meta {
        program: options.program.clone(),
        sources,
        unit: options.unit.clone(),
        root,
        bounds_min,
        bounds_max,
        depth,
        refine,
        stddev,
        tolerance: (tolerance > 0.0).then_some(tolerance),
        numbers: BuildCounts::default(),
        beads: None,
        volumes: None,
        shard: None,
    })
}

/// The name of the way in which pieces are turned.
pub(super) fn way_to_turn(options: &BuildOptions) -> String {
    format!("{:?}", options.orient)
}
