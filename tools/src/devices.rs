//! Which device computes, if any.

use crate::failure::Failure;
use crate::options::with_options;
use crate::units::Size;
use anyhow::anyhow;
use brickfield_engine::backend::{DeviceCheck, Vulkan};
use brickfield_engine::gpu::{DeviceSettings, Gpu, may_be_there};
use clap::{Args, ValueEnum};

/// What computes.
#[derive(Args, Clone, Debug)]
pub struct BackendArgs {
    /// What computes. Results do not depend on it. With the default --refine and --stddev, devices evaluate the bricks of
    /// closed meshes and sum up what closes open ones; everything else is the processor's
    #[arg(long, value_enum, default_value_t)]
    pub backend: BackendArg,
    /// The Vulkan device, by its number or a part of its name; `info --devices` lists them
    #[arg(long, value_name = "NAME|INDEX")]
    pub device: Option<String>,
    /// Most memory to take of the device, as in 2GiB, taken off --memory; by default a quarter of that, or else an
    /// eighth of the device's, 1 GiB at most
    #[arg(long, value_name = "SIZE")]
    pub gpu_memory: Option<Size>,
}

/// The backends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum BackendArg {
    /// For pictures by rays a GPU if there is one, otherwise the processor; for builds and splats the processor, which takes
    /// less time
    #[default]
    Auto,
    /// All processor cores
    Cpu,
    /// A Vulkan device, a GPU or a software driver
    Vulkan,
}

/// Which bricks of a device are computed twice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum DeviceCheckArg {
    /// Every brick
    All,
    /// One in 256, and the first of each kernel
    #[default]
    Some,
    /// No brick
    None,
}

impl From<DeviceCheckArg> for DeviceCheck {
    fn from(check: DeviceCheckArg) -> DeviceCheck {
        match check {
            DeviceCheckArg::All => DeviceCheck::All,
            DeviceCheckArg::Some => DeviceCheck::Some,
            DeviceCheckArg::None => DeviceCheck::None,
        }
    }
}

/// What computes: a device, or the processor and why.
pub enum ComputeDevice {
    Device(Box<Vulkan>),
    Cpu { why: Option<String> },
}

/// Opens the device that was asked for. Automatic choice takes GPUs only, or the device that was named. Where only the
/// build's memory is bounded, batches get a quarter of it. No device is opened by automatic choice where it is known
/// already that the processor does the work, and `why`.
pub fn choose(args: &BackendArgs, memory: Option<Size>, why: Option<&str>) -> Result<ComputeDevice, Failure> {
    let BackendArgs { backend, device, gpu_memory } = args;
    let named = device.is_some();
    if *backend == BackendArg::Cpu {
        if named {
            return Err(Failure::Usage("--device: --backend cpu uses none; leave one out".to_owned()));
        }
        return Ok(ComputeDevice::Cpu { why: None });
    }
    let is_asked_for = *backend == BackendArg::Vulkan || named;
    if let Some(why) = why.filter(|_| !is_asked_for) {
        return Ok(ComputeDevice::Cpu { why: Some(why.to_owned()) });
    }
    if !is_asked_for && !may_be_there() {
        return Ok(ComputeDevice::Cpu { why: Some("the machine has no GPU".to_owned()) });
    }
    let settings = DeviceSettings {
        device: device.clone(),
        real: !is_asked_for,
        memory: gpu_memory.or(memory.map(|size| Size(size.0 / 4))).map_or(0, |size| size.0),
        staging: false,
        validation: false,
    };
    match Gpu::open(&settings) {
        Ok(gpu) => Ok(ComputeDevice::Device(Box::new(Vulkan::new(gpu)))),
        Err(why) if is_asked_for => {
            let why = with_options(&why.to_string());
            Err(anyhow!("--backend vulkan: {why}, or use --backend cpu").into())
        }
        Err(why) => Ok(ComputeDevice::Cpu { why: Some(why.what) }),
    }
}

impl ComputeDevice {
    /// The device.
    pub fn device(&self) -> Option<Vulkan> {
        match self {
            ComputeDevice::Device(vulkan) => Some((**vulkan).clone()),
            ComputeDevice::Cpu { .. } => None,
        }
    }
}
