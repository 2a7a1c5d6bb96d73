//! The logical device that everything on it shares.

use super::failure::{DeviceFailure, DeviceUnavailable, Stage};
use super::hardware::{Hardware, lock, refuse};
use ash::vk;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// A device, its one queue, and how it has been so far.
pub(super) struct Context {
    pub raw: ash::Device,
    queue: Mutex<vk::Queue>,
    /// Whether it failed for good.
    lost: AtomicBool,
    /// Whether it never came back from work that it was given.
    abandoned: AtomicBool,
    // Dropped behind the device.
    pub hardware: Arc<Hardware>,
}

impl Context {
    /// Opens a device, which may be one of several on this hardware.
    pub fn new(hardware: &Arc<Hardware>) -> Result<Context, DeviceUnavailable> {
        let Hardware { physical, family, instance, info, .. } = &**hardware;
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(*family).queue_priorities(&priorities)];
        let features = vk::PhysicalDeviceFeatures::default().shader_int64(true);
        let mut twelve = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
        let create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_features(&features)
            .push_next(&mut twelve);
        // SAFETY: the physical device is the instance's, and has the queue family and the features asked for; what
        // `create` points to lives until the call returns.
        let raw = unsafe { instance.raw.create_device(*physical, &create, None) };
        let raw = raw.map_err(|result| refuse(info, format!("the device cannot be opened ({result})")))?;
        // SAFETY: the family was asked for, with one queue.
        let queue = Mutex::new(unsafe { raw.get_device_queue(*family, 0) });
        Ok(Context {
            raw,
            queue,
            lost: AtomicBool::new(false),
            abandoned: AtomicBool::new(false),
            hardware: Arc::clone(hardware),
        })
    }

    /// Hands a command buffer to the device; `signal` gets `value` when it is done.
    pub fn submit(
        &self,
        commands: vk::CommandBuffer,
        signal: vk::Semaphore,
        value: u64,
    ) -> Result<(), DeviceFailure> {
        self.strike(Stage::Submit)?;
        let (commands, signals, values) = ([commands], [signal], [value]);
        let mut timeline = vk::TimelineSemaphoreSubmitInfo::default().signal_semaphore_values(&values);
        let info = vk::SubmitInfo::default()
            .command_buffers(&commands)
            .signal_semaphores(&signals)
            .push_next(&mut timeline);
        let queue = lock(&self.queue);
        // SAFETY: the queue is used by one thread at a time; the command buffer is recorded and not pending, and the
        // semaphore is a timeline whose value grows; both live until the submission is waited for.
        let done = unsafe { self.raw.queue_submit(*queue, &[info], vk::Fence::null()) };
        done.map_err(|result| self.note(result.into()))
    }

    /// Waits until the semaphore has the value.
    pub fn wait(&self, semaphore: vk::Semaphore, value: u64) -> Result<(), DeviceFailure> {
        /// A batch takes milliseconds on a GPU, and a second on a processor that does a GPU's work beside its own.
        const PATIENCE_NS: u64 = 120_000_000_000;
        let stalls = self.hardware.strike(Stage::Stall).is_some();
        // What nobody has asked for never comes.
        let (value, patience) = if stalls { (value + 1, PATIENCE_NS / 1000) } else { (value, PATIENCE_NS) };
        let (semaphores, values) = ([semaphore], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is a timeline of this device.
        let done = unsafe { self.raw.wait_semaphores(&info, patience) };
        if done == Err(vk::Result::TIMEOUT) {
            // What it is still using must stay where it is.
            self.abandoned.store(true, Ordering::Relaxed);
        }
        done.map_err(|result| self.note(result.into()))?;
        self.strike(Stage::Wait)
    }

    /// Remembers failures that are for good.
    fn note(&self, failure: DeviceFailure) -> DeviceFailure {
        if !failure.may_pass_with_less() {
            self.lost.store(true, Ordering::Relaxed);
        }
        failure
    }

    /// Whether it failed for good.
    pub fn is_lost(&self) -> bool {
        self.lost.load(Ordering::Relaxed)
    }

    /// Whether it may still be using what it was given: nothing can be given back then.
    pub fn is_abandoned(&self) -> bool {
        self.abandoned.load(Ordering::Relaxed)
    }

    /// Fails if a fault that was injected strikes here.
    pub fn strike(&self, stage: Stage) -> Result<(), DeviceFailure> {
        self.hardware.strike(stage).map_or(Ok(()), |failure| Err(self.note(failure)))
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        if self.is_abandoned() {
            // Its driver may still be at work, so that must stay loaded, and the instance behind it: for ever.
            std::mem::forget(Arc::clone(&self.hardware));
            return;
        }
        // SAFETY: whatever lies on the device holds a reference to this, so nothing is left of it, and nothing runs: its
        // owners have waited.
        unsafe { self.raw.destroy_device(None) };
    }
}
