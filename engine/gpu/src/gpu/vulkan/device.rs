//! A device opened for work.

use super::batch::{DeviceSettings, KERNELS};
use super::context::Context;
use super::failure::{DeviceFailure, DeviceUnavailable, InjectedFailure, WrongAnswer};
use super::hardware::Hardware;
use super::info::{DeviceInfo, DeviceKind};
use super::instance::Instance;
use super::kernels::Kernels;
use brickfield_shaders::{BRICK_BUFFERS, EVALUATE, HERMITE, SCAN};
use std::fmt;
use std::sync::{Arc, Mutex, OnceLock};

/// A device with the kernels that evaluate bricks. Clones are handles of the same.
#[derive(Clone)]
pub struct Gpu {
    pub(super) context: Arc<Context>,
    pub(super) kernels: Arc<Kernels>,
    /// See [`Gpu::second`].
    second: Arc<OnceLock<Option<Gpu>>>,
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Gpu").field(&self.context.hardware.info).finish()
    }
}

impl PartialEq for Gpu {
    fn eq(&self, other: &Gpu) -> bool {
        Arc::ptr_eq(&self.context, &other.context)
    }
}

impl Eq for Gpu {}

impl Gpu {
    /// Opens the device that the settings name.
    ///
    /// # Errors
    /// If there is no such device, or it lacks what the kernels need.
    pub fn open(settings: &DeviceSettings) -> Result<Gpu, DeviceUnavailable> {
        let instance = Instance::new(settings.validation)?;
        let found = instance.physical_devices()?;
        let found: Vec<DeviceInfo> =
            found.iter().enumerate().map(|(number, device)| instance.describe(number, *device)).collect();
        let index = choose(&found, settings)?;
        let cap = |info: &DeviceInfo| match settings.memory {
            0 => (info.memory / 8).clamp(64 << 20, 1 << 30),
            bytes => bytes,
        };
        let hardware = Arc::new(Hardware::new(instance, index, cap, settings.staging)?);
        Gpu::on(&hardware)
    }

    fn on(hardware: &Arc<Hardware>) -> Result<Gpu, DeviceUnavailable> {
        let context = Arc::new(Context::new(hardware)?);
        let entries: [_; KERNELS] =
            [(SCAN, c"find"), (SCAN, c"jump"), (EVALUATE, c"walk"), (HERMITE, c"tag"), (HERMITE, c"resolve")];
        let kernels = Kernels::new(&context, BRICK_BUFFERS.len(), &entries).map_err(|failure| {
            let what = format!("{}: the kernels cannot be compiled ({failure})", hardware.info.name);
            DeviceUnavailable::new(what, "update the driver")
        })?;
        Ok(Gpu { kernels: Arc::new(kernels), context, second: Arc::default() })
    }

    /// Another device on the same hardware for half of the threads, where that is of use; opened when it is first asked for.
    /// What is allocated on either counts for both.
    ///
    /// A software driver works on one batch of a device at a time, with all cores, which wait for each other at the end of
    /// each kernel; a second device's batch has them meanwhile. Hardware knows by itself what to do then.
    pub fn second(&self) -> Option<&Gpu> {
        let open = || match self.info().kind {
            DeviceKind::Cpu => Gpu::on(&self.context.hardware).ok(),
            _ => None,
        };
        self.second.get_or_init(open).as_ref()
    }

    /// What it is.
    pub fn info(&self) -> &DeviceInfo {
        &self.context.hardware.info
    }

    /// Bytes that may be allocated.
    pub fn memory(&self) -> u64 {
        self.context.hardware.cap
    }

    /// Bytes that are allocated, and the most that were so far.
    pub fn allocated(&self) -> (u64, u64) {
        self.context.hardware.allocated()
    }

    /// Whether it failed for good; its second may go on.
    pub fn is_lost(&self) -> bool {
        self.context.is_lost()
    }

    /// Where the messages of the validation layer are collected, if it looks on: to the very end of the device, when it
    /// tells what was left behind.
    pub fn messages(&self) -> Arc<Mutex<Vec<String>>> {
        self.context.hardware.instance.messages()
    }

    /// For tests: lets calls fail.
    pub fn inject(&self, fault: InjectedFailure) {
        self.context.hardware.inject(fault);
    }

    /// For tests: has what the device computes overwritten before it is read.
    pub fn spoil(&self, wrong: WrongAnswer) {
        self.context.hardware.spoil(wrong);
    }

    pub(super) fn check(&self) -> Result<(), DeviceFailure> {
        if self.is_lost() { Err(DeviceFailure::Lost) } else { Ok(()) }
    }
}

/// The index of the device that the settings mean.
fn choose(found: &[DeviceInfo], settings: &DeviceSettings) -> Result<usize, DeviceUnavailable> {
    let list: Vec<String> = found.iter().map(|d| format!("{} {} ({})", d.index, d.name, d.kind)).collect();
    let list = list.join(", ");
    if let Some(wanted) = &settings.device {
        let lower = wanted.to_lowercase();
        let by_number = wanted.parse().ok().filter(|number| *number < found.len());
        let by_name = || found.iter().position(|d| d.name.to_lowercase().contains(&lower));
        return by_number.or_else(by_name).ok_or_else(|| {
            DeviceUnavailable::new(format!("there is no device {wanted}"), format!("name one of: {list}"))
        });
    }
    let usable = |d: &&DeviceInfo| if settings.real { d.is_real() } else { d.missing.is_empty() };
    let rank = |d: &&DeviceInfo| (d.kind == DeviceKind::Other, d.kind, d.index);
    found.iter().filter(usable).min_by_key(rank).map(|d| d.index).ok_or_else(|| match settings.real {
        true => DeviceUnavailable::new(
            format!("there is no GPU among the Vulkan devices: {list}"),
            "use `backend` vulkan for a software driver",
        ),
        false => DeviceUnavailable::new(
            format!("no Vulkan device has what is needed: {}", lacks(found)),
            "update the driver",
        ),
    })
}

fn lacks(found: &[DeviceInfo]) -> String {
    let lack = |d: &DeviceInfo| format!("{} lacks {}", d.name, d.missing.join(", "));
    found.iter().map(lack).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(index: usize, name: &str, kind: DeviceKind, missing: Vec<&str>) -> DeviceInfo {
        let missing = missing.into_iter().map(str::to_owned).collect();
        let (driver, version) = (String::new(), String::new());
        DeviceInfo { index, name: name.to_owned(), kind, driver, version, memory: 0, missing }
    }

    #[test]
    fn devices_are_chosen_by_number_name_and_rank() {
        let found = [
            device(0, "llvmpipe (LLVM 15)", DeviceKind::Cpu, vec![]),
            device(1, "Small", DeviceKind::Integrated, vec![]),
            device(2, "Old Card", DeviceKind::Discrete, vec!["timeline semaphores"]),
            device(3, "New Card", DeviceKind::Discrete, vec![]),
        ];
        let chosen = |found: &[DeviceInfo], device: Option<&str>, real| {
            let settings =
                DeviceSettings { device: device.map(str::to_owned), real, ..DeviceSettings::default() };
            choose(found, &settings)
        };
        for (wanted, index) in [("0", 0), ("card", 2), ("new c", 3), ("LLVMpipe", 0)] {
            assert_eq!(chosen(&found, Some(wanted), true), Ok(index));
        }
        assert_eq!((chosen(&found, None, false), chosen(&found, None, true)), (Ok(3), Ok(3)));
        assert_eq!((chosen(&found[..3], None, true), chosen(&found[..1], None, false)), (Ok(1), Ok(0)));
        let none = chosen(&found[..1], None, true).unwrap_err().to_string();
        assert!(none.contains("0 llvmpipe (LLVM 15) (software)"), "{none}");
        let old = chosen(&found[2..3], None, false).unwrap_err().to_string();
        assert!(old.contains("Old Card lacks timeline semaphores"), "{old}");
        for unknown in ["4", "voodoo"] {
            let message = chosen(&found, Some(unknown), false).unwrap_err().to_string();
            assert!(message.contains(unknown) && message.contains("3 New Card"), "{message}");
        }
    }
}
