//! What is taken off the counts of an open soup, and how its nodes are refined.

use super::corners::corner_at;
use super::field::PieceList;
use crate::backend::{DeviceShares, ShareQueue, Vulkan};
use crate::brick::Samples;
use crate::error::{Error, Result};
use crate::ingest::Facets;
use crate::lattice::{NodeKey, RootCube, Triangle};
use crate::progress::Progress;
use crate::store::Refine;
use crate::winding::{
    CornerGrid, FAR_FIELD_BYTES, OpenEvaluator, OpenField, OpenPart, TriangleList, bytes_of_caps,
};

/// The sum over the caps of an open soup, and what evaluates it.
pub(super) struct OpenSoup {
    pub field: OpenField,
    /// What sums over the caps, if it is not the processor alone.
    device: Option<DeviceShares>,
}

/// Evaluates bricks of open soups.
#[derive(Default)]
pub(super) struct OpenSoupEvaluator {
    cpu: OpenEvaluator,
    queue: ShareQueue,
}

impl OpenSoup {
    /// Closes the soup of all sources, for a tree of this depth. Its caps must fit in `memory` bytes, of which a quarter may be
    /// taken while they are found.
    ///
    /// # Errors
    /// If its caps take more, or 16 bits are not enough for samples that are off by at most `error`.
    pub fn close(
        sources: &[&dyn Facets],
        root: RootCube,
        (error, depth): (f64, u8),
        (memory, device): (u64, Option<&Vulkan>),
        progress: &dyn Progress,
    ) -> Result<OpenSoup> {
        let part = OpenPart::within(memory / 4, sources, root, progress)?;
        let field = OpenField::new(part, error, depth)?;
        OpenSoup::require_room(&field, memory)?;
        Ok(OpenSoup { field, device: device.map(DeviceShares::new) })
    }

    /// The memory that the caps of a field take.
    ///
    /// # Errors
    /// If that is more than `memory`.
    pub fn require_room(field: &OpenField, memory: u64) -> Result<u64> {
        let need = OpenSoup::bytes_of(field);
        if need <= memory {
            return Ok(need);
        }
        let mib = |bytes: u64| bytes.div_ceil(1 << 20);
        let caps = field.part().summary.caps;
        Err(Error::setting(
            format!(
                "the surface is open, and the {caps} triangles that close it need {} MiB of the {} MiB that there are",
                mib(need),
                mib(memory)
            ),
            "allow more with `memory`, or close the surface",
        ))
    }

    /// Memory that the caps take for as long as it lives.
    pub fn bytes(&self) -> u64 {
        OpenSoup::bytes_of(&self.field)
    }

    fn bytes_of(field: &OpenField) -> u64 {
        bytes_of_caps(field.part().summary.caps) + FAR_FIELD_BYTES
    }

    /// The caps, which are a part of the soup's triangles.
    pub fn caps(&self) -> &[Triangle] {
        &self.field.part().caps
    }

    /// By how much samples may be off.
    pub fn error(&self) -> f64 {
        self.field.error()
    }

    /// Whether some triangles are not caps alone.
    pub fn has_facet(&self, list: TriangleList<'_>) -> bool {
        list.indices.iter().any(|&i| !self.field.is_cap(&list.array[i as usize]))
    }

    /// Whether a device helps.
    pub fn has_device(&self) -> bool {
        self.device.is_some()
    }

    /// The samples of a brick in which the caps count, from counts with the caps.
    pub fn samples(
        &self,
        evaluator: &mut OpenSoupEvaluator,
        key: NodeKey,
        counts: &Samples,
    ) -> Result<Samples> {
        let OpenSoupEvaluator { cpu, queue } = evaluator;
        let found =
            self.device.as_ref().and_then(|device| Some((device, queue.take(device, &self.field, key)?)));
        let Some((device, shares)) = found else { return self.field.samples(cpu, key, counts) };
        let samples = self.field.samples_with(cpu, key, counts, &shares)?;
        device.check(key, &samples, || self.field.samples(cpu, key, counts))?;
        Ok(samples)
    }

    /// Tells which nodes are evaluated next.
    pub fn foresee(&self, evaluator: &mut OpenSoupEvaluator, nodes: impl Iterator<Item = NodeKey>) {
        if let Some(device) = &self.device {
            let keys: Vec<NodeKey> = nodes.filter(|key| !self.field.is_quiet(*key)).collect();
            let OpenSoupEvaluator { cpu, queue } = evaluator;
            queue.find(device, &self.field, cpu, &keys);
        }
    }
}

/// The corners of the children of a node that a facet touches: it has hidden crossings.
pub(super) fn refined_unseen(
    open: &OpenSoup,
    refine: Refine,
    key: NodeKey,
    corner: i16,
    list: PieceList<'_, Triangle>,
) -> Option<[i16; 8]> {
    let pieces = || list.indices.iter().map(|&i| &list.array[i as usize]);
    if refine != Refine::Hidden || pieces().all(|t| open.field.is_cap(t)) {
        return None;
    }
    let mut grid = CornerGrid::new(key, 1);
    pieces().for_each(|t| grid.add(t));
    let counts = grid.finish(i64::from(OpenField::corner_count(key, corner)));
    Some(std::array::from_fn(|octant| corner_at(&counts, 1, octant)))
}
