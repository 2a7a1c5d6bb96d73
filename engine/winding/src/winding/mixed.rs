//! The field of meshes and point clouds together: the exact counts of the meshes, less the sums over the caps of open ones,
//! plus the sums over the dipoles of the clouds.
//!
//! Both sums share the error: each takes half of it if there are caps, else the clouds' takes all. Rounding is a part of
//! both halves and is done once.

use super::cloud::{CloudBricks, CloudEvaluator, Surfels};
use super::evaluate::TriangleList;
use super::open::{OpenBrick, OpenEvaluator, OpenField, OpenPart, are_near, fixed_point};
use crate::brick::Samples;
use crate::error::Result;
use crate::lattice::{NodeKey, RootCube, Triangle};

/// The field of meshes and clouds.
#[derive(Debug)]
pub struct MixedField {
    cloud: CloudBricks,
    /// The caps of the meshes, if these are open.
    open: Option<OpenField>,
    bits: u8,
    error: f64,
}

/// Working memory; one per thread.
#[derive(Default)]
pub struct MixedEvaluator {
    cloud: CloudEvaluator,
    open: OpenEvaluator,
}

impl MixedField {
    /// Of clouds, and of meshes that `open` closes if they are open, with samples that are off by at most `error`, for a
    /// tree whose deepest bricks are of a level.
    ///
    /// # Errors
    /// [`crate::error::Error::Setting`] if samples of 16 bits cannot be that exact.
    pub fn new(
        surfels: Surfels,
        open: Option<OpenPart>,
        root: RootCube,
        error: f64,
        depth: u8,
    ) -> Result<MixedField> {
        let of_each = if open.is_some() { 0.5 * error } else { error };
        let cloud = CloudBricks::new(surfels, root, of_each, depth)?;
        let open = open.map(|part| OpenField::new(part, of_each, depth)).transpose()?;
        let bits = cloud.binary_places().max(open.as_ref().map_or(0, OpenField::binary_places));
        Ok(MixedField { cloud, open, bits, error })
    }

    /// The clouds' part.
    pub fn cloud(&self) -> &CloudBricks {
        &self.cloud
    }

    /// The part of the caps, if the meshes are open.
    pub fn open(&self) -> Option<&OpenField> {
        self.open.as_ref()
    }

    /// Whether a triangle is a cap; a facet may lie on one.
    pub fn is_cap(&self, t: &Triangle) -> bool {
        self.open.as_ref().is_some_and(|open| open.is_cap(t))
    }

    /// The samples of a brick with these counts of the meshes and their caps. A sample's value depends on its position and
    /// on nothing else. Samples on the root's own faces count as outside.
    ///
    /// # Errors
    /// [`crate::error::Error::Setting`] if a winding number does not fit 16 bits.
    pub fn samples(&self, scratch: &mut MixedEvaluator, key: NodeKey, counts: &Samples) -> Result<Samples> {
        let MixedEvaluator { cloud, open } = scratch;
        let values = counts.0.iter().zip(self.cloud.sums(cloud, key));
        let values = values.map(|(count, sum)| f64::from(*count) + sum);
        match &self.open {
            None => fixed_point(key, self.bits, values),
            Some(field) => {
                let caps = field.sums(open, key);
                fixed_point(key, self.bits, values.zip(caps).map(|(w, sum)| w - sum))
            }
        }
    }

    /// A brick of these counts and samples, which these triangles of meshes and caps touch.
    pub fn brick(
        &self,
        key: NodeKey,
        counts: &Samples,
        samples: Samples,
        list: TriangleList<'_>,
    ) -> OpenBrick {
        let facets = match &self.open {
            Some(open) => open.facets(list),
            None => list.indices.iter().map(|&i| list.array[i as usize]).collect(),
        };
        OpenBrick::of_facets((samples, counts.child_corners()), key, facets, self.error)
    }

    /// A brick whose Hermite edges are those of its counts.
    pub fn tame_brick(&self, key: NodeKey, samples: Samples) -> OpenBrick {
        OpenBrick::smooth(samples, key, self.error)
    }

    /// Whether what the clouds and the caps add, at most a quarter at all samples of a brick that neither a ball nor a cap
    /// touches, moves no passage of 0.5: that is where the count passes it.
    pub fn is_tame(&self, counts: &Samples, samples: &Samples, list: TriangleList<'_>) -> bool {
        are_near(counts, samples) && list.indices.iter().all(|&i| !self.is_cap(&list.array[i as usize]))
    }
}
