//! The logical device that everything on it shares.

use super::failure::{Failure, Fault, Stage, Unavailable};
use super::instance::{DeviceInfo, DeviceKind, Instance, Messages};
use super::memory::Use;
use ash::vk;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A device, its one queue, and how it has been so far.
pub(super) struct Context {
    pub raw: ash::Device,
    pub info: DeviceInfo,
    pub family: u32,
    /// Nanoseconds of a tick of its clock; `None` if it has none.
    pub tick_ns: Option<f32>,
    /// Bytes that a kernel can see of a buffer.
    pub range_max: u64,
    /// Bytes that may be allocated.
    pub cap: u64,
    /// Whether data are copied to and from the device even where its memory is the host's.
    stages: bool,
    allocated: Mutex<Allocated>,
    memory: vk::PhysicalDeviceMemoryProperties,
    queue: Mutex<vk::Queue>,
    /// Whether it failed for good.
    lost: AtomicBool,
    /// Whether it never came back from work that it was given.
    abandoned: AtomicBool,
    faults: Mutex<Vec<Fault>>,
    // Dropped behind the device.
    instance: Instance,
}

/// Memory as fast for the host as for the device.
const IN_COMMON: vk::MemoryPropertyFlags = vk::MemoryPropertyFlags::from_raw(
    vk::MemoryPropertyFlags::DEVICE_LOCAL.as_raw()
        | vk::MemoryPropertyFlags::HOST_VISIBLE.as_raw()
        | vk::MemoryPropertyFlags::HOST_COHERENT.as_raw()
        | vk::MemoryPropertyFlags::HOST_CACHED.as_raw(),
);

/// Bytes of all allocations.
#[derive(Clone, Copy, Default)]
struct Allocated {
    now: u64,
    peak: u64,
}

impl Context {
    /// Opens the device with this number. `cap` says how many bytes may be allocated; for `stages` see
    /// [`super::device::Settings::staging`].
    pub fn new(
        instance: Instance,
        index: usize,
        cap: impl FnOnce(&DeviceInfo) -> u64,
        stages: bool,
    ) -> Result<Context, Unavailable> {
        let physical = instance.physical_devices()?[index];
        let info = instance.describe(index, physical);
        let refuse = |what: String| {
            Unavailable::new(
                format!("{}: {what}", info.name),
                "name another with --device, or use --backend cpu",
            )
        };
        if !info.missing.is_empty() {
            return Err(refuse(format!("the device lacks {}", info.missing.join(", "))));
        }
        let Some((family, clock_bits)) = instance.compute_family(physical) else {
            return Err(refuse("the device does not compute".to_owned()));
        };
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
        let features = vk::PhysicalDeviceFeatures::default().shader_int64(true);
        let mut twelve = vk::PhysicalDeviceVulkan12Features::default().timeline_semaphore(true);
        let create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_features(&features)
            .push_next(&mut twelve);
        // SAFETY: the physical device is the instance's, and has the queue family and the features asked for; what
        // `create` points to lives until the calls return.
        let (raw, properties, memory) = unsafe {
            let raw = instance.raw.create_device(physical, &create, None);
            let properties = instance.raw.get_physical_device_properties(physical);
            (raw, properties, instance.raw.get_physical_device_memory_properties(physical))
        };
        let raw = raw.map_err(|result| refuse(format!("the device cannot be opened ({result})")))?;
        // SAFETY: the family was asked for, with one queue.
        let queue = Mutex::new(unsafe { raw.get_device_queue(family, 0) });
        let limits = properties.limits;
        Ok(Context {
            raw,
            cap: cap(&info),
            stages,
            allocated: Mutex::default(),
            info,
            family,
            tick_ns: (clock_bits >= 64).then_some(limits.timestamp_period),
            range_max: limits.max_storage_buffer_range.into(),
            memory,
            queue,
            lost: AtomicBool::new(false),
            abandoned: AtomicBool::new(false),
            faults: Mutex::new(Vec::new()),
            instance,
        })
    }

    /// The type of memory for a purpose among those allowed, the best first.
    pub fn memory_type(&self, allowed: u32, purpose: Use) -> Option<u32> {
        use vk::MemoryPropertyFlags as Flags;
        let visible = Flags::HOST_VISIBLE | Flags::HOST_COHERENT;
        // Vulkan has a type that is both visible and coherent, and one that is the device's, on every machine.
        let wishes = match purpose {
            Use::Device if self.shares_memory() => [IN_COMMON, visible],
            Use::Device => [Flags::DEVICE_LOCAL, Flags::empty()],
            Use::Upload => [visible, visible],
            Use::ReadBack => [visible | Flags::HOST_CACHED, visible],
        };
        let types = self.memory.memory_types_as_slice();
        let fits = |wish: Flags| {
            let suits =
                |(i, t): (usize, &vk::MemoryType)| allowed >> i & 1 != 0 && t.property_flags.contains(wish);
            types.iter().enumerate().position(suits).map(|i| i as u32)
        };
        wishes.into_iter().find_map(fits)
    }

    /// Whether buffers are written and read where kernels use them. A card may show its memory to the host, too, but reading
    /// it there is slow.
    pub fn shares_memory(&self) -> bool {
        let is_hosts = matches!(self.info.kind, DeviceKind::Integrated | DeviceKind::Cpu);
        let types = self.memory.memory_types_as_slice();
        is_hosts && !self.stages && types.iter().any(|t| t.property_flags.contains(IN_COMMON))
    }

    /// Counts bytes that are about to be allocated, if there may be so many more.
    pub fn reserve(&self, bytes: u64) -> Result<(), Failure> {
        let mut allocated = lock(&self.allocated);
        let now = allocated.now.saturating_add(bytes);
        if now > self.cap {
            return Err(Failure::OutOfMemory);
        }
        *allocated = Allocated { now, peak: allocated.peak.max(now) };
        Ok(())
    }

    /// Counts bytes that were given back.
    pub fn release(&self, bytes: u64) {
        lock(&self.allocated).now -= bytes;
    }

    /// Bytes that are allocated, and the most that were.
    pub fn allocated(&self) -> (u64, u64) {
        let Allocated { now, peak } = *lock(&self.allocated);
        (now, peak)
    }

    /// Hands a command buffer to the device; `signal` gets `value` when it is done.
    pub fn submit(
        &self,
        commands: vk::CommandBuffer,
        signal: vk::Semaphore,
        value: u64,
    ) -> Result<(), Failure> {
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
    pub fn wait(&self, semaphore: vk::Semaphore, value: u64) -> Result<(), Failure> {
        /// A batch takes milliseconds on a GPU, and a second on a processor that does a GPU's work beside its own.
        const PATIENCE_NS: u64 = 120_000_000_000;
        let (semaphores, values) = ([semaphore], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is a timeline of this device.
        let done = unsafe { self.raw.wait_semaphores(&info, PATIENCE_NS) };
        if done == Err(vk::Result::TIMEOUT) {
            // What it is still using must stay where it is.
            self.abandoned.store(true, Ordering::Relaxed);
        }
        done.map_err(|result| self.note(result.into()))?;
        self.strike(Stage::Wait)
    }

    /// Remembers failures that are for good.
    fn note(&self, failure: Failure) -> Failure {
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

    pub fn inject(&self, fault: Fault) {
        lock(&self.faults).push(fault);
    }

    /// Fails if a fault that was injected strikes here.
    pub fn strike(&self, stage: Stage) -> Result<(), Failure> {
        let mut faults = lock(&self.faults);
        let Some(fault) = faults.iter_mut().find(|fault| fault.stage == stage && fault.times > 0) else {
            return Ok(());
        };
        if fault.after > 0 {
            fault.after -= 1;
            return Ok(());
        }
        fault.times -= 1;
        let failure = fault.failure;
        drop(faults);
        Err(self.note(failure))
    }

    pub fn messages(&self) -> Arc<Messages> {
        self.instance.messages()
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        if !self.is_abandoned() {
            // SAFETY: whatever lies on the device holds a reference to this, so nothing is left of it, and nothing
            // runs: its owners have waited.
            unsafe { self.raw.destroy_device(None) };
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
