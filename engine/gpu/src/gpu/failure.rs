//! What can go wrong with a device, before work begins and amid it.

#[cfg(feature = "vulkan")]
use ash::vk;
use std::fmt;

/// Why there is no device to work with, and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}; {remedy}")]
pub struct DeviceUnavailable {
    /// What is missing.
    pub what: String,
    /// What the user can do.
    pub remedy: String,
}

impl DeviceUnavailable {
    pub(super) fn new(what: impl fmt::Display, remedy: impl fmt::Display) -> DeviceUnavailable {
        DeviceUnavailable { what: what.to_string(), remedy: remedy.to_string() }
    }
}

/// Why a device did not do its work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeviceFailure {
    /// It is gone, or stopped answering.
    #[error("the device was lost")]
    Lost,
    /// It has no memory left, of its own or of the machine's.
    #[error("the device is out of memory")]
    OutOfMemory,
    /// It did not finish in time.
    #[error("the device did not finish in time")]
    Timeout,
    /// The driver refused a call.
    #[cfg(feature = "vulkan")]
    #[error("the driver refused: {0}")]
    Refused(vk::Result),
}

impl DeviceFailure {
    /// Whether the same device can be asked again, for less.
    pub fn may_pass_with_less(self) -> bool {
        self == DeviceFailure::OutOfMemory
    }
}

#[cfg(feature = "vulkan")]
impl From<vk::Result> for DeviceFailure {
    fn from(result: vk::Result) -> DeviceFailure {
        match result {
            vk::Result::ERROR_DEVICE_LOST => DeviceFailure::Lost,
            vk::Result::TIMEOUT => DeviceFailure::Timeout,
            vk::Result::ERROR_OUT_OF_DEVICE_MEMORY
            | vk::Result::ERROR_OUT_OF_HOST_MEMORY
            | vk::Result::ERROR_OUT_OF_POOL_MEMORY
            | vk::Result::ERROR_TOO_MANY_OBJECTS => DeviceFailure::OutOfMemory,
            other => DeviceFailure::Refused(other),
        }
    }
}

/// Where a [`InjectedFailure`] strikes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// As memory is taken.
    Allocate,
    /// As a batch is handed to the device.
    Submit,
    /// As a batch is waited for.
    Wait,
    /// As a batch is waited for, too: the device does not come back, for the wait is for work that it never gets.
    Stall,
    /// As memory is given back: it never is.
    FreeMemory,
    /// As the commands of a batch are given back: they never are.
    FreeCommands,
}

/// A failure that a test wants to see, in place of the call that it strikes. Where something is to be given back it is a
/// leak, a mistake that tests are shown to find.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InjectedFailure {
    /// Where it strikes.
    pub stage: Stage,
    /// How many calls pass before.
    pub after: u32,
    /// How many calls it strikes.
    pub times: u32,
    /// What they return.
    pub failure: DeviceFailure,
}

/// What a test writes over what a device has computed, as a wrong driver would.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrongAnswer {
    /// Zeros in the place of every batch.
    Zeros,
    /// One sample of one brick is 1 more.
    OneSample {
        /// How many batches are right before, of those that all threads receive.
        after: u32,
    },
}
