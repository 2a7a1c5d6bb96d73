//! How much memory there is and was used.

use crate::units::Size;
use std::fs;
use std::path::Path;

/// Memory of the machine, or of the control group that the program runs in if that is less.
pub fn available() -> Option<Size> {
    let machine = field(Path::new("/proc/meminfo"), "MemTotal:");
    machine.into_iter().chain(group_limits()).min()
}

/// Limits of all control groups around this process, of both versions.
fn group_limits() -> Vec<Size> {
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let mut limits = Vec::new();
    for line in groups.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(group)) = (parts.next(), parts.next()) else { continue };
        let (mount, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            _ if controllers.split(',').any(|name| name == "memory") => {
                ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => continue,
        };
        for group in Path::new(group.trim_start_matches('/')).ancestors() {
            let text = fs::read_to_string(Path::new(mount).join(group).join(file)).unwrap_or_default();
            limits.extend(text.trim().parse().ok().map(Size));
        }
    }
    limits
}

/// The most memory that this process has held, maps of files included.
pub fn peak() -> Option<Size> {
    field(Path::new("/proc/self/status"), "VmHWM:")
}

/// A value in kB from a file of `name: value kB` lines; `None` where the system has no such file.
fn field(path: &Path, name: &str) -> Option<Size> {
    let text = fs::read_to_string(path).ok()?;
    let value = text.lines().find_map(|line| line.strip_prefix(name))?;
    Some(Size(value.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024))
}
