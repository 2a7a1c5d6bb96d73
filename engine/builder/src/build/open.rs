//! The field of an open soup as sorting, jobs and subtrees see it.

use super::bins::{Binner, SortedRun};
use super::field::{Evaluated, Field, Fractions, Pieces};
use super::sorted::SortedPieces;
use super::subtree::corner_at;
use crate::backend::{DeviceShares, Leaf, ShareQueue, Vulkan};
use crate::brick::{Brick, Samples};
use crate::error::Result;
use crate::ingest::{Facets, runs};
use crate::lattice::{CubeTest, NodeKey, RootCube, Triangle, Units, bounds, has_area};
use crate::progress::Progress;
use crate::store::Refine;
use crate::winding::{CornerGrid, OpenBrick, OpenEvaluator, OpenField, OpenPiece};
use rayon::prelude::*;

/// The field of an open soup, and what evaluates it.
pub(super) struct OpenSoup {
    pub field: OpenField,
    /// What sums over the caps, if it is not the processor alone.
    pub device: Option<DeviceShares>,
}

impl OpenSoup {
    /// Evaluated on the processor, or with a device.
    pub fn new(field: OpenField, device: Option<&Vulkan>) -> OpenSoup {
        OpenSoup { field, device: device.map(DeviceShares::new) }
    }
}

/// Evaluates bricks of open soups.
#[derive(Default)]
pub(super) struct OpenSoupEvaluator {
    cpu: OpenEvaluator,
    queue: ShareQueue,
}

impl Field for OpenSoup {
    type Piece = OpenPiece;
    /// Corners are counts of the parent, or of its pieces: no node is reached but through its parent.
    type Corners = ();
    type Evaluator = OpenSoupEvaluator;
    type Evaluation<'a> = OpenBrick;

    fn binary_places(&self) -> u8 {
        self.field.binary_places()
    }

    fn bounds(&self, piece: &OpenPiece) -> (Units, Units) {
        bounds(&piece.triangle)
    }

    fn points(&self, piece: &OpenPiece) -> [Units; 3] {
        piece.triangle
    }

    fn cube_test(&self, piece: &OpenPiece, size: i32) -> impl Fn(Units) -> bool {
        let test = CubeTest::new(&piece.triangle, size);
        move |low| test.touches(low)
    }

    fn is_void(&self, piece: &OpenPiece) -> bool {
        !has_area(&piece.triangle)
    }

    fn corners(&self, _: NodeKey, _: u8) {}

    fn add_corners(&self, (): &mut (), _: &OpenPiece) {}

    fn merge_corners(&self, (): &mut (), (): &()) {}

    fn finish_corners(&self, (): (), _: i64) -> Vec<i64> {
        Vec::new()
    }

    /// The field changes everywhere.
    fn settled(&self, _: NodeKey, _: i16, _: Pieces<'_, OpenPiece>) -> Option<i16> {
        None
    }

    /// A node that a facet touches has hidden crossings.
    fn refined_unseen(
        &self,
        refine: Refine,
        key: NodeKey,
        corner: i16,
        list: Pieces<'_, OpenPiece>,
    ) -> Option<[i16; 8]> {
        let pieces = || list.indices.iter().map(|&i| &list.array[i as usize]);
        if refine != Refine::Hidden || pieces().all(|piece| piece.cap) {
            return None;
        }
        let mut grid = CornerGrid::new(key, 1);
        pieces().for_each(|piece| grid.add(&piece.triangle));
        let counts = grid.finish(i64::from(OpenField::corner_count(key, corner)));
        Some(std::array::from_fn(|octant| corner_at(&counts, 1, octant)))
    }

    fn evaluate<'a>(
        &'a self,
        evaluator: &'a mut OpenSoupEvaluator,
        key: NodeKey,
        corner: i16,
        list: Pieces<'a, OpenPiece>,
    ) -> Result<OpenBrick> {
        let pieces = || list.indices.iter().map(|&i| list.array[i as usize]);
        let OpenSoupEvaluator { cpu, queue } = evaluator;
        let found =
            self.device.as_ref().and_then(|device| Some((device, queue.take(device, &self.field, key)?)));
        let Some((device, shares)) = found else { return self.field.evaluate(cpu, key, corner, pieces()) };
        let brick = self.field.evaluate_with(cpu, key, corner, pieces(), &shares)?;
        let here = || Ok(self.field.evaluate(cpu, key, corner, pieces())?.samples);
        device.check(key, &brick.samples, here)?;
        Ok(brick)
    }

    fn foresee(&self, evaluator: &mut OpenSoupEvaluator, nodes: &[Leaf<'_, OpenPiece>]) {
        if let Some(device) = &self.device {
            let keys: Vec<NodeKey> = nodes.iter().map(|node| node.key).collect();
            evaluator.queue.find(device, &self.field, &keys);
        }
    }

    fn foresees(&self) -> bool {
        self.device.is_some()
    }
}

impl Evaluated for OpenBrick {
    fn samples(&self) -> &Samples {
        &self.samples
    }

    fn into_samples(self) -> Samples {
        self.samples
    }

    fn corners(&self) -> [i16; 8] {
        self.corner_counts
    }

    fn has_hidden_crossings(&mut self) -> bool {
        self.is_touched()
    }

    fn has_hidden_boundary(&mut self) -> bool {
        self.may_hide_boundary()
    }

    fn into_leaf(self) -> Result<Brick> {
        Ok(OpenBrick::into_leaf(self))
    }

    fn fractions(&self) -> Option<Fractions> {
        Some(Fractions { bits: self.samples.1, straight: self.is_straight() })
    }
}

/// All triangles of the sources and the caps, for a tree whose nodes decide from the root on.
pub(super) fn gather(
    soup: &OpenSoup,
    sources: &[&dyn Facets],
    root: RootCube,
    progress: &dyn Progress,
) -> Result<SortedPieces<OpenSoup>> {
    let snapper = root.snapper();
    let binner = Binner::new(NodeKey::ROOT, 0);
    let of_run = |(source, range): (usize, std::ops::Range<u64>)| {
        let mut world = Vec::new();
        if !progress.cancelled() {
            sources[source].read(range, &mut world);
        }
        let piece = |t: [[f64; 3]; 3]| OpenPiece { triangle: t.map(snapper), cap: false };
        world.into_iter().map(piece).collect::<Vec<OpenPiece>>()
    };
    let runs: Vec<SortedRun<OpenPiece>> =
        runs(sources).into_par_iter().map(|run| SortedRun::new(soup, &binner, &of_run(run))).collect();
    progress.check()?;
    let mut sorted = SortedPieces::default();
    runs.into_iter().for_each(|run| sorted.push_sorted(run));
    let caps: Vec<OpenPiece> =
        soup.field.part().caps.iter().map(|&triangle: &Triangle| OpenPiece { triangle, cap: true }).collect();
    sorted.push(soup, &binner, &caps);
    Ok(sorted)
}
