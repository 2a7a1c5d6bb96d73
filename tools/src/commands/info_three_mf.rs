//! `brickfield info` of a 3MF file: its objects, and what is built of them.

use super::start;
use crate::args::InfoArgs;
use crate::failure::Failure;
use crate::output::{in_line, one_line, print, print_json};
use crate::units::Size;
use crate::work::{ProgressArg, WorkArgs};
use brickfield_engine::ingest::{ThreeMf, ThreeMfItem, ThreeMfObject};
use serde_json::json;
use std::path::Path;

/// Objects and items that are listed for people; `--json` lists all.
const LISTED: usize = 20;

/// Runs the command.
pub fn run(file: &Path, args: &InfoArgs) -> Result<(), Failure> {
    let bars = start(WorkArgs { threads: args.threads, quiet: args.json, progress: ProgressArg::Auto })?;
    let found = ThreeMf::read(file, &bars)?;
    bars.clear();
    if args.json {
        let mut said = json!({ "path": file.display().to_string(), "format": "3MF", "read_by_build": true });
        if let (Some(said), Ok(serde_json::Value::Object(all))) =
            (said.as_object_mut(), serde_json::to_value(&found))
        {
            said.extend(all);
        }
        return print_json(&said);
    }
    let ThreeMf { bytes, unit, application, objects, items, vertices, triangles, unlisted } = found;
    let mut text =
        format!("{}: 3MF, {} objects, {} build items, ", in_line(file), objects.len(), items.len());
    text += &format!("{vertices} vertices, {triangles} triangles, {}\n", Size(bytes));
    text += &format!("  unit     {}\n", one_line(&unit));
    if let Some(application) = application {
        text += &format!("  made by  {}\n", one_line(&application));
    }
    for ThreeMfObject { id, name, kind, vertices, triangles, components, .. } in objects.iter().take(LISTED) {
        let name = name.as_ref().map_or_else(String::new, |name| format!(" \"{name}\""));
        let group = if *components > 0 { format!(", {components} components") } else { String::new() };
        text +=
            &format!("  object   {id}{name}: {kind}, {vertices} vertices, {triangles} triangles{group}\n");
    }
    for ThreeMfItem { object, transform } in items.iter().take(LISTED) {
        let placed = transform.as_ref().map_or_else(String::new, |matrix| format!(", placed by {matrix}"));
        text += &format!("  item     object {object}{placed}\n");
    }
    let more = objects.len().saturating_sub(LISTED) + items.len().saturating_sub(LISTED);
    if more as u64 + unlisted > 0 {
        text += &format!("  and {} more (--json lists up to 10,000 of each)\n", more as u64 + unlisted);
    }
    print(&text)
}
