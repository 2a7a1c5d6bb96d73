//! The hardware of a device: what it offers, and what devices opened on it have in common.

use super::failure::{DeviceFailure, DeviceUnavailable, InjectedFailure, Stage, WrongAnswer};
use super::info::{DeviceInfo, DeviceKind};
use super::instance::Instance;
use ash::vk;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What memory is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MemoryUse {
    /// Kernels; written and read here, too, where the device's memory is the host's.
    Device,
    /// Written here, read by the device.
    Upload,
    /// Written by the device, read here.
    ReadBack,
}

/// Hardware as a driver shows it, its memory counted.
pub(super) struct Hardware {
    pub physical: vk::PhysicalDevice,
    pub info: DeviceInfo,
    /// Of its queues.
    pub family: u32,
    /// Nanoseconds of a tick of its clock; `None` if it has none.
    pub tick_ns: Option<f32>,
    /// Bytes that a kernel can see of a buffer.
    pub range_max: u64,
    /// Bytes that may be allocated, on all devices together.
    pub cap: u64,
    /// Whether data are copied to and from devices even where their memory is the host's.
    stages: bool,
    allocated: Mutex<Allocated>,
    memory: vk::PhysicalDeviceMemoryProperties,
    faults: Mutex<Vec<InjectedFailure>>,
    wrong: Mutex<Option<WrongAnswer>>,
    pub instance: Instance,
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

impl Hardware {
    /// The hardware with this number. `cap` says how many bytes may be allocated; for `stages` see
    /// [`super::device::DeviceSettings::staging`].
    pub fn new(
        instance: Instance,
        index: usize,
        cap: impl FnOnce(&DeviceInfo) -> u64,
        stages: bool,
    ) -> Result<Hardware, DeviceUnavailable> {
        let physical = instance.physical_devices()?[index];
        let info = instance.describe(index, physical);
        if !info.missing.is_empty() {
            return Err(refuse(&info, format!("the device lacks {}", info.missing.join(", "))));
        }
        let Some((family, clock_bits)) = instance.compute_family(physical) else {
            return Err(refuse(&info, "the device does not compute".to_owned()));
        };
        // SAFETY: the physical device is the instance's.
        let (limits, memory) = unsafe {
            let limits = instance.raw.get_physical_device_properties(physical).limits;
            (limits, instance.raw.get_physical_device_memory_properties(physical))
        };
        Ok(Hardware {
            physical,
            cap: cap(&info),
            stages,
            allocated: Mutex::default(),
            info,
            family,
            tick_ns: (clock_bits >= 64).then_some(limits.timestamp_period),
            range_max: limits.max_storage_buffer_range.into(),
            memory,
            faults: Mutex::new(Vec::new()),
            wrong: Mutex::new(None),
            instance,
        })
    }

    /// The type of memory for a purpose among those allowed, the best first.
    pub fn memory_type(&self, allowed: u32, purpose: MemoryUse) -> Option<u32> {
        use vk::MemoryPropertyFlags as Flags;
        let visible = Flags::HOST_VISIBLE | Flags::HOST_COHERENT;
        // Vulkan has a type that is both visible and coherent, and one that is the device's, on every machine.
        let wishes = match purpose {
            MemoryUse::Device if self.shares_memory() => [IN_COMMON, visible],
            MemoryUse::Device => [Flags::DEVICE_LOCAL, Flags::empty()],
            MemoryUse::Upload => [visible, visible],
            MemoryUse::ReadBack => [visible | Flags::HOST_CACHED, visible],
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
    pub fn reserve(&self, bytes: u64) -> Result<(), DeviceFailure> {
        let mut allocated = lock(&self.allocated);
        let now = allocated.now.saturating_add(bytes);
        if now > self.cap {
            return Err(DeviceFailure::OutOfMemory);
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

    /// Lets calls fail, on whichever device they are.
    pub fn inject(&self, fault: InjectedFailure) {
        lock(&self.faults).push(fault);
    }

    /// Has answers overwritten, of whichever device they are.
    pub fn spoil(&self, wrong: WrongAnswer) {
        *lock(&self.wrong) = Some(wrong);
    }

    /// What the batch that has just come is to be overwritten with.
    pub fn wrong_answer(&self) -> Option<WrongAnswer> {
        let mut wrong = lock(&self.wrong);
        match &mut *wrong {
            Some(WrongAnswer::OneSample { after: after @ 1.. }) => {
                *after -= 1;
                None
            }
            Some(WrongAnswer::OneSample { .. }) => wrong.take(),
            all => *all,
        }
    }

    /// The failure that was injected for here and now, if one was.
    pub fn strike(&self, stage: Stage) -> Option<DeviceFailure> {
        let mut faults = lock(&self.faults);
        let fault = faults.iter_mut().find(|fault| fault.stage == stage && fault.times > 0)?;
        if fault.after > 0 {
            fault.after -= 1;
            return None;
        }
        fault.times -= 1;
        Some(fault.failure)
    }
}

/// Says that hardware is of no use.
pub(super) fn refuse(info: &DeviceInfo, what: String) -> DeviceUnavailable {
    DeviceUnavailable::new(format!("{}: {what}", info.name), "name another with `device`")
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
