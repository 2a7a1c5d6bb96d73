//! How far a device is believed, and what was seen of it.

use crate::lattice::{GOLDEN, NodeKey, mix};
use std::sync::atomic::AtomicBool;

/// One brick in so many is computed by the processor as well, if only some are.
pub const CHECKED_ONE_IN: u64 = 256;

/// Which bricks of a device the processor computes as well.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceCheck {
    /// Every one: no brick of the device is written unless it is the processor's. It takes longer than without a device.
    All,
    /// One in [`CHECKED_ONE_IN`], which a hash of the node's key decides, and the first ones of each kernel.
    ///
    /// A fault that strikes a share f of the bricks, whichever they are, is missed in n bricks with a probability of
    /// (1 − f / 256)^n, or about e^(−f n / 256). That is 1 % for 1,180 wrong bricks, 37 % for 256, and 99.6 % for one.
    #[default]
    Some,
    /// None.
    None,
}

/// Kernels that are begun together, and are checked for themselves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum KernelSet {
    /// Bricks that become leaves.
    Leaves,
    /// Nodes that may be divided.
    Nodes,
    /// Sums over the caps of open soups.
    Sums,
}

/// What was seen of one device on the hardware.
#[derive(Debug, Default)]
pub(super) struct DeviceObservations {
    /// By kernels: whether a brick with a sign change was as expected.
    pub plain: [AtomicBool; 3],
    /// Whether one was in which crossings are hidden, which a kernel of its own resolves.
    pub hidden: [AtomicBool; 3],
}

/// What was seen of a device, and whether it is still believed.
#[derive(Debug, Default)]
pub(super) struct DeviceTrust {
    /// Of the first and the second device on the hardware.
    pub seen: [DeviceObservations; 2],
    pub is_lost: AtomicBool,
}

impl DeviceTrust {
    /// Whether a brick is one in [`CHECKED_ONE_IN`], the same ones in every build.
    pub fn is_drawn(key: NodeKey) -> bool {
        mix(key.code().wrapping_add(GOLDEN)).is_multiple_of(CHECKED_ONE_IN)
    }
}
