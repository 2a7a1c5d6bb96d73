//! A Vulkan device that evaluates the bricks of closed soups.

use super::report::DeviceReport;
use super::trust::{DeviceCheck, DeviceTrust};
use crate::gpu::{DeviceFailure, DeviceLane, Gpu, Seconds};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A device for builds, and what it did so far. Clones are handles of the same.
#[derive(Clone, Debug)]
pub struct Vulkan {
    gpu: Gpu,
    report: Arc<Mutex<DeviceReport>>,
    pub(super) check: DeviceCheck,
    pub(super) trust: Arc<DeviceTrust>,
}

impl PartialEq for Vulkan {
    fn eq(&self, other: &Vulkan) -> bool {
        self.gpu == other.gpu
    }
}

impl Eq for Vulkan {}

/// The smallest memory with which a lane is worth having: some bricks a batch.
const LANE_BYTES_MIN: u64 = 4 << 20;

/// Batches behind which half of the threads have a device of their own, if that is of use ([`Gpu::second`]): to open it
/// takes some 50 ms of processor time.
const BATCHES_OF_ONE: u64 = 48;

impl Vulkan {
    /// Of an open device, some of whose bricks are checked.
    pub fn new(gpu: Gpu) -> Vulkan {
        let name = gpu.info().name.clone();
        let report = Arc::new(Mutex::new(DeviceReport { name, ..DeviceReport::default() }));
        Vulkan { gpu, report, check: DeviceCheck::default(), trust: Arc::default() }
    }

    /// The same device with other bricks checked.
    pub fn with_check(self, check: DeviceCheck) -> Vulkan {
        Vulkan { check, ..self }
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// What it did since it was last asked.
    pub fn take_report(&self) -> DeviceReport {
        let fresh = DeviceReport { name: self.gpu.info().name.clone(), ..DeviceReport::default() };
        let report = std::mem::replace(&mut *self.report(), fresh);
        DeviceReport { peak_bytes: self.gpu.allocated().1, ..report }
    }

    pub(super) fn report(&self) -> MutexGuard<'_, DeviceReport> {
        self.report.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The device that has the batches of this thread.
    pub(super) fn of_thread(&self) -> &Gpu {
        let is_second = rayon::current_thread_index().is_some_and(|number| number % 2 == 1);
        let is_worth_it = is_second && self.report().batches >= BATCHES_OF_ONE;
        let second = if is_worth_it { self.gpu.second() } else { None };
        second.unwrap_or(&self.gpu)
    }

    /// A lane on a device for one of the pool's threads; `None` if the device has no room for it or fails.
    pub(super) fn lane(&self, gpu: &Gpu) -> Option<DeviceLane> {
        let mut bytes = gpu.memory() / rayon::current_num_threads() as u64;
        loop {
            match DeviceLane::new(gpu, bytes) {
                Ok(lane) => return Some(lane),
                Err(failure) => self.note_failure(failure),
            }
            bytes /= 2;
            if gpu.is_lost() || bytes < LANE_BYTES_MIN {
                return None;
            }
            self.report().retries += 1;
        }
    }

    pub(super) fn note_failure(&self, failure: DeviceFailure) {
        self.report().failure.get_or_insert_with(|| failure.to_string());
    }

    pub(super) fn note_batch(&self, seconds: Option<Seconds>, bricks: usize) {
        let mut report = self.report();
        report.batches += 1;
        report.bricks += bricks as u64;
        if let Some(Seconds { upload, kernels, read }) = seconds {
            report.upload_seconds += upload;
            report.kernel_seconds.iter_mut().zip(kernels).for_each(|(sum, seconds)| *sum += seconds);
            report.read_seconds += read;
        }
    }
}
