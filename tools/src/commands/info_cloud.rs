//! `brickfield info` of a point cloud: its columns, its spacing, its normals, and what `build` would make of it.

use super::info::point;
use super::start;
use crate::args::InfoArgs;
use crate::clouds::open_clouds;
use crate::failure::Failure;
use crate::options::error_with_options;
use crate::output::{one_line, print, print_json};
use crate::progress::Bars;
use crate::units::Size;
use crate::work::{ProgressArg, WorkArgs};
use brickfield_engine::Progress;
use brickfield_engine::build::{cloud_cells, surfels};
use brickfield_engine::ingest::CloudInput;
use brickfield_engine::winding::{Surfels, median_distance};
use serde_json::json;
use std::path::Path;

/// What `build` makes of a cloud by default.
struct Plan {
    void: u64,
    spacing: f64,
    cell: f64,
    depth: u8,
}

impl Plan {
    /// Of a cloud with normals; why there is none otherwise.
    fn of(cloud: CloudInput, bars: &Bars) -> Result<Plan, String> {
        let surfels: Surfels = surfels(vec![cloud], false, bars).map_err(error_with_options)?;
        let (cell, depth) = cloud_cells(&surfels).map_err(error_with_options)?;
        Ok(Plan { void: surfels.void, spacing: surfels.spacing, cell, depth })
    }
}

/// Runs the command.
pub fn run(file: &Path, args: &InfoArgs) -> Result<(), Failure> {
    let bars = start(WorkArgs { threads: args.threads, quiet: args.json, progress: ProgressArg::Auto })?;
    let Some(cloud) = open_clouds(&[file.to_owned()], &args.room.of_arrays(), &bars)?.pop() else {
        return Ok(());
    };
    bars.phase("measuring", Some(cloud.cloud.points.len() as u64), "points");
    let distance = median_distance(&cloud.cloud.points)?;
    let (format, bytes, points) = (cloud.describe(), cloud.bytes(), cloud.cloud.points.len());
    let (min, max) = cloud.cloud.bounds();
    let (columns, normals, told) = (cloud.columns.clone(), cloud.normals(), cloud.columns_text());
    let warnings = cloud.warnings();
    let plan = Plan::of(cloud, &bars);
    bars.clear();
    let path = file.display().to_string();
    if args.json {
        let build = match &plan {
            Ok(Plan { void, spacing, cell, depth }) => json!({
                "void_points": void, "spacing": spacing, "cell": cell, "depth": depth,
            }),
            Err(why) => json!({ "refused": why }),
        };
        return print_json(&json!({
            "path": path,
            "format": format,
            "bytes": bytes,
            "points": points,
            "bounds": [min, max],
            "columns": columns.names,
            "columns_named": columns.named,
            "decimal_commas": columns.decimal_commas,
            "neighbour_distance": distance,
            "normals": normals,
            "no_normals": columns.no_normals,
            "warnings": warnings,
            "build": build,
        }));
    }
    let mut text = format!("{}: {format}, {points} points, {}\n", one_line(&path), Size(bytes));
    text += &format!("  bounds   {} to {}\n", point(min), point(max));
    text += &format!("  columns  {}\n", one_line(&told));
    text += &format!("  spacing  {distance:.6} from a point to its nearest neighbour (median)\n");
    text += &match plan {
        Ok(Plan { void, spacing, cell, depth }) => format!(
            "  build    takes {points} points ({void} without area), {spacing:.6} apart, by default with cells of \
             {cell:.6} (depth {depth})\n"
        ),
        Err(why) if normals.is_none() => {
            format!("  build    refuses it without --estimate-normals: {}\n", reason(&why, &path))
        }
        Err(why) => format!("  build    refuses it: {}\n", reason(&why, &path)),
    };
    print(&text)
}

/// An error without the name of the file, which stands above it.
fn reason<'a>(error: &'a str, path: &str) -> &'a str {
    error.strip_prefix(path).map_or(error, |rest| rest.trim_start_matches(": "))
}
