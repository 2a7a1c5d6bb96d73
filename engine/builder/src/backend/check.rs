//! How far a device is believed: which of its bricks the processor computes as well, and what a difference means.
//!
//! A device that no test has seen may compute anything. So some of its bricks are computed here, too, before they are
//! handed on, and compared with what the processor would write. After the first difference nothing of the device counts:
//! the build ends with [`Error::Distrusted`], and its caller begins anew without the device, with an empty store.

use super::batch::BatchLeaf;
use super::node_brick::NodeBrick;
use super::trust::{DeviceCheck, DeviceTrust, KernelSet};
use super::vulkan::Vulkan;
use crate::brick::{Brick, SignChanges};
use crate::error::{Error, Result};
use crate::lattice::{Axis, NodeKey};
use crate::winding::Evaluator;
use std::sync::atomic::{AtomicBool, Ordering};

/// A brick of a device that may be checked.
#[derive(Clone, Copy)]
pub(super) struct CheckCandidate {
    pub key: NodeKey,
    pub kernels: KernelSet,
    /// Whether the second device on the hardware has made it.
    pub is_seconds: bool,
    /// Whether crossings are hidden in it.
    pub has_hidden: bool,
}

impl Vulkan {
    /// Whether the device was caught with a wrong brick.
    pub fn is_distrusted(&self) -> bool {
        self.trust.is_lost.load(Ordering::Relaxed)
    }

    /// Whether the processor is to compute a brick as well.
    pub(super) fn is_to_check(&self, claim: CheckCandidate) -> bool {
        let seen = &self.trust.seen[usize::from(claim.is_seconds)];
        let kernels = claim.kernels as usize;
        let is_first = || {
            let is_seen = |seen: &AtomicBool| seen.load(Ordering::Relaxed);
            !is_seen(&seen.plain[kernels]) || claim.has_hidden && !is_seen(&seen.hidden[kernels])
        };
        match self.check {
            DeviceCheck::All => true,
            DeviceCheck::Some => DeviceTrust::is_drawn(claim.key) || is_first(),
            DeviceCheck::None => false,
        }
    }

    /// Notes what came of a check. Bricks without a sign change (`is_telling`) leave the kernels unseen: a device that
    /// returns zeros gets these right.
    ///
    /// # Errors
    /// [`Error::Distrusted`] if the device's brick is another.
    pub(super) fn note_check(&self, claim: CheckCandidate, is_equal: bool, is_telling: bool) -> Result<()> {
        self.report().checked += 1;
        if !is_equal {
            return Err(self.distrust(claim.key));
        }
        if is_telling {
            let seen = &self.trust.seen[usize::from(claim.is_seconds)];
            let kernels = claim.kernels as usize;
            seen.plain[kernels].store(true, Ordering::Relaxed);
            seen.hidden[kernels].fetch_or(claim.has_hidden, Ordering::Relaxed);
        }
        Ok(())
    }

    /// Nothing of the device counts any more.
    pub(super) fn distrust(&self, key: NodeKey) -> Error {
        self.trust.is_lost.store(true, Ordering::Relaxed);
        let info = self.gpu().info();
        let (device, driver) = (info.name.clone(), info.driver.clone());
        let error = Error::Distrusted { device, driver, node: key.to_string() };
        self.report().wrong.get_or_insert_with(|| error.to_string());
        error
    }
}

/// Compares what a device made of a node with the processor's, if it is to be checked.
///
/// # Errors
/// [`Error::Distrusted`] if it is another; as [`Evaluator::evaluate`].
pub(super) fn check(
    vulkan: &Vulkan,
    (kernels, is_seconds): (KernelSet, bool),
    node: &BatchLeaf<'_>,
    found: &NodeBrick,
    evaluator: &mut Evaluator,
) -> Result<()> {
    if vulkan.is_distrusted() || !is_sound(found) {
        return Err(vulkan.distrust(node.key));
    }
    let has_hidden = found.has_hidden_crossings();
    let claim = CheckCandidate { key: node.key, kernels, is_seconds, has_hidden };
    if !vulkan.is_to_check(claim) {
        return Ok(());
    }
    let here = node.evaluate(evaluator)?;
    let is_hidden_alike = here.has_hidden_crossings() == has_hidden;
    let brick = here.into_leaf()?;
    let is_telling = matches!(&brick, Brick::Counts { hermite, .. } if !hermite.is_empty());
    vulkan.note_check(claim, is_hidden_alike && found.is_brick(&brick), is_telling)
}

/// Whether a brick is one that can be written: an edge for each sign change.
fn is_sound(found: &NodeBrick) -> bool {
    let Some(hermite) = &found.hermite else { return true };
    let counts = Axis::ALL.map(|axis| hermite.edges[axis.index()].len());
    counts == SignChanges::of(&found.samples).counts()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Neither too many nor too few are drawn, on any level, and always the same ones.
    #[test]
    fn one_brick_in_256_is_drawn() {
        for level in [5u8, 9, 15] {
            let keys = (0..1u32 << 15).map(|n| {
                let position = [n & 31, n >> 5 & 31, n >> 10];
                NodeKey::new(level, position).unwrap()
            });
            let drawn = keys.filter(|key| DeviceTrust::is_drawn(*key)).count();
            assert!((90..170).contains(&drawn), "level {level}: {drawn} of 32768");
        }
        assert!(DeviceTrust::is_drawn(NodeKey::ROOT) == DeviceTrust::is_drawn(NodeKey::ROOT));
    }
}
