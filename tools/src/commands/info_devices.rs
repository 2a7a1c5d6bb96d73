//! `brickfield info --devices`: the Vulkan devices of the machine.

use crate::failure::Failure;
use crate::output::{print, print_json};
use crate::units::Size;
use anyhow::anyhow;
use brickfield_engine::gpu::{DeviceInfo, devices};
use serde_json::json;

/// Runs the command.
pub fn run(as_json: bool) -> Result<(), Failure> {
    let found = devices().map_err(|why| anyhow!("{why}"))?;
    if as_json {
        let object = |d: &DeviceInfo| {
            json!({
                "index": d.index,
                "name": d.name,
                "kind": d.kind.to_string(),
                "driver": d.driver,
                "vulkan": d.version,
                "memory_bytes": d.memory,
                "missing": d.missing,
            })
        };
        return print_json(&found.iter().map(object).collect::<Vec<_>>());
    }
    let line = |d: &DeviceInfo| {
        let lacks = match d.missing.is_empty() {
            true => String::new(),
            false => format!("; cannot be used: it lacks {}", d.missing.join(", ")),
        };
        let DeviceInfo { index, name, kind, driver, version, memory, .. } = d;
        format!("{index}  {name}, {kind}, {}, Vulkan {version}, {driver}{lacks}\n", Size(*memory))
    };
    print(&found.iter().map(line).collect::<String>())
}
