//! What a device is, as a user is told.

use std::fmt;

/// What a device is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DeviceKind {
    /// A card of its own.
    Discrete,
    /// A part of the processor.
    Integrated,
    /// A part of one, lent by a virtual machine's host.
    Virtual,
    /// The processor itself, by a software driver.
    Cpu,
    /// None of these.
    Other,
}

impl fmt::Display for DeviceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            DeviceKind::Discrete => "discrete",
            DeviceKind::Integrated => "integrated",
            DeviceKind::Virtual => "virtual",
            DeviceKind::Cpu => "software",
            DeviceKind::Other => "other",
        })
    }
}

/// A device of the machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Its number, as the loader counts them.
    pub index: usize,
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: DeviceKind,
    /// The driver's name and version.
    pub driver: String,
    /// Vulkan's version.
    pub version: String,
    /// Bytes of its largest heap of own memory.
    pub memory: u64,
    /// What the kernels need and it lacks; empty if it can be used.
    pub missing: Vec<String>,
}

impl DeviceInfo {
    /// Whether it is a GPU that the kernels can use, and no software driver.
    pub fn is_real(&self) -> bool {
        self.missing.is_empty() && !matches!(self.kind, DeviceKind::Cpu | DeviceKind::Other)
    }
}

/// Whether the machine may have a GPU, as far as its device files tell: asking the drivers takes a tenth of a second.
pub fn may_be_there() -> bool {
    let is_there = |path: &str| std::path::Path::new(path).exists();
    !cfg!(target_os = "linux")
        || ["/dev/dri", "/dev/nvidiactl", "/dev/dxg", "/dev/kfd"].into_iter().any(is_there)
}
