//! The field of beads as analytic solids.

use super::bins::Binner;
use super::field::{BrickEvaluation, PieceField, PieceList};
use super::sorted::SortedPieces;
use crate::brick::{Brick, Samples, ThinFeatures, ThinLines};
use crate::error::Result;
use crate::lattice::{NodeKey, ROOT_BITS, Units, spacing_bits};
use crate::progress::Progress;
use crate::solid::{Segment, SegmentList, SolidEvaluation, SolidEvaluator, Solids};
use rayon::prelude::*;

/// Segments sorted at a time: 0.5 MB, an L2 cache.
const RUN_SEGMENTS: usize = 1 << 14;

impl PieceField for Solids {
    type Piece = Segment;
    /// A brick lists whole solids, not surfaces, so that no sample needs to be known before.
    type Corners = ();
    type Evaluator = SolidEvaluator;
    type Evaluation<'a> = SolidEvaluation<'a>;

    #[inline]
    fn bounds(&self, segment: &Segment) -> (Units, Units) {
        Solids::bounds(self, segment)
    }

    #[inline]
    fn points(&self, segment: &Segment) -> [Units; 3] {
        [segment.a, segment.a, segment.b]
    }

    #[inline]
    fn cube_test(&self, segment: &Segment, size: i32) -> impl Fn(Units) -> bool {
        move |low| self.touches_cube(segment, low, size)
    }

    #[inline]
    fn is_void(&self, segment: &Segment) -> bool {
        !self.profile(segment).is_solid()
    }

    fn corners(&self, _: NodeKey, _: u8) {}

    fn add_corners(&self, (): &mut (), _: &Segment) {}

    fn merge_corners(&self, (): &mut (), (): &()) {}

    fn finish_corners(&self, (): (), _: i64) -> Vec<i64> {
        Vec::new()
    }

    /// No segment at all, or every one covers the cube as a whole.
    fn settled(&self, key: NodeKey, _: i16, list: PieceList<'_, Segment>) -> Option<i16> {
        let low = key.base().map(|b| b + 1);
        let size = 1 << (ROOT_BITS - u32::from(key.level()));
        let segments = || list.indices.iter().map(|&i| &list.array[i as usize]);
        if !segments().all(|segment| self.covers_cube(segment, low, size)) {
            return None;
        }
        let mut passes: Vec<u32> = segments().map(|segment| segment.pass).collect();
        passes.sort_unstable();
        passes.dedup();
        let followed = passes.windows(2).filter(|pair| pair[0] + 1 == pair[1]);
        let mut joints = followed.filter_map(|pair| self.joint(pair[1]));
        if joints.any(|joint| self.touches_cube(joint, low, size)) {
            return None;
        }
        // Where this does not fit, the evaluation of a brick says so.
        i16::try_from(passes.len()).ok()
    }

    /// Only beads that are thinner than a cell can be walls that no sample shows.
    fn may_hide_walls(&self, level: u8) -> bool {
        let spacing = f64::from(1u32 << spacing_bits(level));
        self.profiles().iter().any(|p| p.is_solid() && 2.0 * p.half_width.min(p.half_height) < spacing)
    }

    fn evaluate<'a>(
        &'a self,
        evaluator: &'a mut SolidEvaluator,
        key: NodeKey,
        _: i16,
        list: PieceList<'a, Segment>,
    ) -> Result<SolidEvaluation<'a>> {
        evaluator.evaluate(self, key, SegmentList { array: list.array, indices: list.indices })
    }
}

impl BrickEvaluation for SolidEvaluation<'_> {
    fn samples(&self) -> &Samples {
        &self.samples
    }

    fn into_samples(self) -> Samples {
        self.samples
    }

    fn has_hidden_crossings(&mut self) -> bool {
        SolidEvaluation::has_hidden_crossings(self)
    }

    fn has_hidden_boundary(&mut self) -> bool {
        SolidEvaluation::has_hidden_boundary(self)
    }

    fn thin(&mut self, lines: ThinLines) -> Result<ThinFeatures> {
        Ok(SolidEvaluation::thin(self, lines))
    }

    fn into_leaf(self) -> Result<Brick> {
        Ok(SolidEvaluation::into_leaf(self))
    }
}

/// Sorts segments for jobs in the cubes of `binner`.
pub(super) fn sort_segments(
    solids: &Solids,
    segments: &[Segment],
    binner: Binner,
    progress: &dyn Progress,
) -> Result<SortedPieces<Solids>> {
    let runs: Vec<SortedPieces<Solids>> = segments
        .par_chunks(RUN_SEGMENTS)
        .map(|run| {
            progress.check()?;
            let mut sorted = SortedPieces::default();
            sorted.push(solids, &binner, run);
            progress.advance(run.len() as u64);
            Ok(sorted)
        })
        .collect::<Result<_>>()?;
    let mut all = SortedPieces::default();
    runs.into_iter().for_each(|run| all.merge(solids, run));
    Ok(all)
}
