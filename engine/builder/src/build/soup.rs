//! The field of a soup as sorting, jobs and subtrees see it.
//!
//! An open soup is a closed one, its caps among the triangles, less the sum over the caps. Where that counts for nothing,
//! its bricks are those of the closed one.

use super::field::{BrickEvaluation, Fractions, PieceField, PieceList};
use super::fit::MeshTolerance;
use super::open::{self, OpenSoup, OpenSoupEvaluator};
use crate::backend::{BatchLeaf, LeafQueue, NodeBrick, NodeQueue, Vulkan};
use crate::brick::{Brick, Hermite, Samples, ThinFeatures, ThinLines};
use crate::error::Result;
use crate::lattice::{CubeTest, NodeKey, Triangle, Units, bounds, has_area};
use crate::store::Refine;
use crate::winding::{CornerGrid, Evaluation, Evaluator, OpenBrick, OpenField, TriangleList};

/// The field of a soup of triangles.
#[derive(Default)]
pub(super) struct Soup {
    /// What evaluates bricks of a closed soup, if it is not the processor.
    pub device: Option<Vulkan>,
    /// What is taken off the counts of an open one, whose caps are among the triangles.
    pub open: Option<OpenSoup>,
}

impl Soup {
    /// A closed one, evaluated on the processor.
    pub const CPU: Soup = Soup { device: None, open: None };
}

/// Evaluates bricks of soups, on the processor or a device.
#[derive(Default)]
pub(super) struct SoupEvaluator {
    cpu: Evaluator,
    leaves: LeafQueue,
    nodes: NodeQueue,
    open: OpenSoupEvaluator,
}

/// What is known of a brick of a soup, evaluated by the processor or by a device.
pub(super) enum SoupEvaluation<'a> {
    /// Of an open soup, where the caps count.
    Open(Box<OpenEvaluation<'a>>),
    /// By the processor.
    Here(Evaluation<'a>),
    /// By a device.
    There(DeviceEvaluation<'a>),
}

/// A brick of an open soup in which the caps count.
pub(super) struct OpenEvaluation<'a> {
    pub brick: OpenBrick,
    /// The counts with the caps, if what is added moves no passage of 0.5: then these have the brick's Hermite edges.
    pub counts: Option<Evaluation<'a>>,
    /// Whether a facet touches it.
    pub is_touched: bool,
}

/// What a device found, and from what.
pub(super) struct DeviceEvaluation<'a> {
    found: NodeBrick,
    node: BatchLeaf<'a>,
    evaluator: &'a mut Evaluator,
}

impl PieceField for Soup {
    type Piece = Triangle;
    type Corners = CornerGrid;
    type Evaluator = SoupEvaluator;
    type Evaluation<'a> = SoupEvaluation<'a>;

    #[inline]
    fn bounds(&self, t: &Triangle) -> (Units, Units) {
        bounds(t)
    }

    #[inline]
    fn points(&self, t: &Triangle) -> [Units; 3] {
        *t
    }

    #[inline]
    fn cube_test(&self, t: &Triangle, size: i32) -> impl Fn(Units) -> bool {
        let test = CubeTest::new(t, size);
        move |low| test.touches(low)
    }

    /// A triangle without area crosses nothing.
    #[inline]
    fn is_void(&self, t: &Triangle) -> bool {
        !has_area(t)
    }

    fn corners(&self, node: NodeKey, stride: u8) -> CornerGrid {
        CornerGrid::new(node, stride)
    }

    #[inline]
    fn add_corners(&self, corners: &mut CornerGrid, t: &Triangle) {
        corners.add(t);
    }

    fn merge_corners(&self, corners: &mut CornerGrid, other: &CornerGrid) {
        corners.merge(other);
    }

    fn finish_corners(&self, corners: CornerGrid, corner: i64) -> Vec<i64> {
        corners.finish(corner)
    }

    fn settled(&self, key: NodeKey, corner: i16, list: PieceList<'_, Triangle>) -> Option<i16> {
        (list.indices.is_empty() && !self.is_restless(key)).then_some(corner)
    }

    fn is_restless(&self, key: NodeKey) -> bool {
        self.open.as_ref().is_some_and(|open| !open.field.is_quiet(key))
    }

    fn may_be_restless(&self) -> bool {
        self.open.is_some()
    }

    fn refined_unseen(
        &self,
        refine: Refine,
        key: NodeKey,
        corner: i16,
        list: PieceList<'_, Triangle>,
    ) -> Option<[i16; 8]> {
        self.open.as_ref().and_then(|open| open::refined_unseen(open, refine, key, corner, list))
    }

    fn evaluate<'a>(
        &'a self,
        evaluator: &'a mut SoupEvaluator,
        key: NodeKey,
        corner: i16,
        list: PieceList<'a, Triangle>,
    ) -> Result<SoupEvaluation<'a>> {
        let SoupEvaluator { cpu, nodes, open: of_open, .. } = evaluator;
        let node = BatchLeaf { key, corner, array: list.array, indices: list.indices };
        if let Some(open) = &self.open {
            return evaluate_open(open, of_open, cpu, node);
        }
        let found = match &self.device {
            Some(device) => nodes.take_checked(device, cpu, &node)?,
            None => None,
        };
        match found {
            Some(found) => Ok(SoupEvaluation::There(DeviceEvaluation { found, node, evaluator: cpu })),
            None => Ok(SoupEvaluation::Here(node.evaluate(cpu)?)),
        }
    }

    fn fits(
        &self,
        evaluator: &mut SoupEvaluator,
        tolerance: &MeshTolerance,
        node: BatchLeaf<'_>,
        brick: Brick,
    ) -> Result<(Brick, bool)> {
        let triangles = node.indices.iter().map(|&i| &node.array[i as usize]);
        let (brick, fits) = tolerance.fits(node.key, brick, triangles)?;
        // Few nodes come so far, and the boundary hides in hardly one of these.
        Ok((brick, fits && !node.evaluate(&mut evaluator.cpu)?.has_hidden_boundary()))
    }

    fn foresee(&self, evaluator: &mut SoupEvaluator, nodes: &[BatchLeaf<'_>]) {
        if let Some(open) = &self.open {
            open.foresee(&mut evaluator.open, nodes.iter().map(|node| node.key));
        } else if let Some(device) = &self.device {
            evaluator.nodes.find(device, nodes);
        }
    }

    fn foresees(&self) -> bool {
        self.device.is_some() || self.open.as_ref().is_some_and(OpenSoup::has_device)
    }

    fn begin_leaves(&self, evaluator: &mut SoupEvaluator) -> bool {
        self.device.as_ref().inspect(|device| evaluator.leaves.begin(device)).is_some()
    }

    fn may_hide_walls(&self, _: u8) -> bool {
        true
    }

    fn next_leaf(
        &self,
        evaluator: &mut SoupEvaluator,
        leaves: &[BatchLeaf<'_>],
    ) -> Result<(Brick, ThinFeatures)> {
        let device = self.device.as_ref().expect("leaves were begun");
        evaluator.leaves.next(device, &mut evaluator.cpu, leaves)
    }

    fn leaves_together(&self) -> u64 {
        /// Two batches: while the bricks of one are encoded the device has the next. At 32 leaves llvmpipe took 4 % longer
        /// at 1024³; at 512 it takes no less, and fewer jobs are there for threads.
        const LEAVES: u64 = 128;
        if self.device.is_some() { LEAVES } else { 1 }
    }
}

/// Evaluates a brick of an open soup on the processor, with sums over the caps from a device if it has them.
fn evaluate_open<'a>(
    open: &'a OpenSoup,
    evaluator: &mut OpenSoupEvaluator,
    cpu: &'a mut Evaluator,
    node: BatchLeaf<'a>,
) -> Result<SoupEvaluation<'a>> {
    let counts =
        BatchLeaf { corner: OpenField::corner_count(node.key, node.corner), ..node }.evaluate(cpu)?;
    if open.field.is_quiet(node.key) {
        open.field.require_room(node.key, &counts.samples)?;
        return Ok(SoupEvaluation::Here(counts));
    }
    let list = TriangleList { array: node.array, indices: node.indices };
    let samples = open.samples(evaluator, node.key, &counts.samples)?;
    let is_tame = open.field.is_tame(&counts.samples, &samples, list);
    let brick = match is_tame {
        true => OpenBrick::smooth(samples, node.key, open.error()),
        false => open.field.brick(node.key, &counts.samples, samples, list),
    };
    let open = OpenEvaluation { brick, counts: is_tame.then_some(counts), is_touched: open.has_facet(list) };
    Ok(SoupEvaluation::Open(Box::new(open)))
}

impl BrickEvaluation for OpenEvaluation<'_> {
    fn samples(&self) -> &Samples {
        &self.brick.samples
    }

    fn into_samples(self) -> Samples {
        self.brick.samples
    }

    fn corners(&self) -> [i16; 8] {
        self.counts.as_ref().map_or(self.brick.corner_counts, |counts| counts.samples.child_corners())
    }

    fn fractions(&self) -> Option<Fractions> {
        Some(Fractions { bits: self.brick.samples.1, straight: self.brick.is_straight() })
    }

    fn has_hidden_crossings(&mut self) -> bool {
        self.is_touched
    }

    fn has_hidden_boundary(&mut self) -> bool {
        self.counts.as_ref().map_or_else(|| self.brick.may_hide_boundary(), Evaluation::has_hidden_boundary)
    }

    fn into_leaf(self) -> Result<Brick> {
        let Some(counts) = self.counts else { return Ok(self.brick.into_leaf()) };
        let hermite = match counts.into_leaf()? {
            Brick::Uniform(_) => Hermite::default(),
            Brick::Counts { hermite, .. } => hermite,
        };
        Ok(self.brick.into_leaf_with(hermite))
    }
}

impl DeviceEvaluation<'_> {
    /// Where no edge holds crossings of either way, the running count along it passes 0.5 once at most. Where one does,
    /// their order tells, which the processor finds.
    fn has_hidden_boundary(&mut self) -> bool {
        if !self.found.has_hidden_crossings() {
            return false;
        }
        let here = self.node.evaluate(self.evaluator);
        here.expect("its samples fit 16 bits on the device").has_hidden_boundary()
    }

    /// As [`DeviceEvaluation::has_hidden_boundary`]: the processor looks where one may be.
    fn thin(&mut self, lines: ThinLines) -> Result<ThinFeatures> {
        if !self.found.may_hide() {
            return Ok(ThinFeatures::default());
        }
        Ok(self.node.evaluate(self.evaluator)?.thin(lines))
    }
}

impl BrickEvaluation for SoupEvaluation<'_> {
    fn samples(&self) -> &Samples {
        match self {
            SoupEvaluation::Open(open) => open.samples(),
            SoupEvaluation::Here(evaluation) => &evaluation.samples,
            SoupEvaluation::There(evaluation) => &evaluation.found.samples,
        }
    }

    fn into_samples(self) -> Samples {
        match self {
            SoupEvaluation::Open(open) => open.into_samples(),
            SoupEvaluation::Here(evaluation) => evaluation.samples,
            SoupEvaluation::There(evaluation) => evaluation.found.samples,
        }
    }

    fn corners(&self) -> [i16; 8] {
        match self {
            SoupEvaluation::Open(open) => open.corners(),
            SoupEvaluation::Here(_) | SoupEvaluation::There(_) => self.samples().child_corners(),
        }
    }

    fn fractions(&self) -> Option<Fractions> {
        match self {
            SoupEvaluation::Open(open) => open.fractions(),
            SoupEvaluation::Here(_) | SoupEvaluation::There(_) => None,
        }
    }

    fn has_hidden_crossings(&mut self) -> bool {
        match self {
            SoupEvaluation::Open(open) => open.has_hidden_crossings(),
            SoupEvaluation::Here(evaluation) => evaluation.has_hidden_crossings(),
            SoupEvaluation::There(evaluation) => evaluation.found.has_hidden_crossings(),
        }
    }

    fn has_hidden_boundary(&mut self) -> bool {
        match self {
            SoupEvaluation::Open(open) => open.has_hidden_boundary(),
            SoupEvaluation::Here(evaluation) => evaluation.has_hidden_boundary(),
            SoupEvaluation::There(evaluation) => evaluation.has_hidden_boundary(),
        }
    }

    fn thin(&mut self, lines: ThinLines) -> Result<ThinFeatures> {
        match self {
            SoupEvaluation::Open(_) => Ok(ThinFeatures::default()),
            SoupEvaluation::Here(evaluation) => Ok(evaluation.thin(lines)),
            SoupEvaluation::There(evaluation) => evaluation.thin(lines),
        }
    }

    fn into_leaf(self) -> Result<Brick> {
        match self {
            SoupEvaluation::Open(open) => open.into_leaf(),
            SoupEvaluation::Here(evaluation) => evaluation.into_leaf(),
            SoupEvaluation::There(evaluation) => Ok(evaluation.found.into_leaf()),
        }
    }
}
