//! `brickfield info` of a mesh: how large it is, and whether it is closed.

use super::info::point;
use super::{open_inputs, start};
use crate::args::InfoArgs;
use crate::failure::Failure;
use crate::memory;
use crate::output::{one_line, print, print_json, warn};
use crate::pieces::{inside_out_text, pieces_text};
use crate::units::Size;
use crate::work::{ProgressArg, WorkArgs};
use anyhow::anyhow;
use brickfield_engine::build::{Measures, is_closed, measure};
use brickfield_engine::ingest::{Facets, OpenOptions};
use brickfield_engine::lattice::RootCube;
use brickfield_engine::pieces::{Consistency, study};
use brickfield_engine::winding::{OpenPart, OpenSummary};
use brickfield_engine::{Error, Progress};
use serde_json::json;
use std::path::Path;

/// Whether the name is that of a mesh.
pub fn is_mesh(path: &Path) -> bool {
    let ending = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    ending.is_some_and(|e| ["stl", "obj", "ply"].contains(&e.as_str()))
}

/// Runs the command.
pub fn run(file: &Path, args: &InfoArgs) -> Result<(), Failure> {
    let bars = start(WorkArgs { threads: None, quiet: args.json, progress: ProgressArg::Auto })?;
    let inputs = open_inputs(&[file.to_owned()], &[], &OpenOptions::default(), &bars)?;
    let input = &inputs[0];
    let path = input.path().display().to_string();
    let (min, max) = input.bounds(&bars)?;
    let root = RootCube::around(min, max).ok_or_else(|| {
        anyhow!(
            "{path}: bounds: the input spans {min:?} to {max:?}, which fits no lattice; give it an extent"
        )
    })?;
    let sources: [&dyn Facets; 1] = [input];
    let memory = memory::budget(None).map_or(u64::MAX, |size| size.0);
    let (pieces, not_told) = match study(&sources, root, Consistency::Given, memory, &bars) {
        Ok((report, _)) => (Some(report), String::new()),
        Err(Error::Setting { what, .. }) => (None, what),
        Err(error) => return Err(error.into()),
    };
    let summary = if is_closed(&sources, root, &bars)? {
        OpenSummary::default()
    } else {
        OpenPart::of(&[input], root, &bars)?.summary
    };
    bars.phase("measuring", Some(input.facets()), "facets");
    let Measures { area, volume, .. } = measure(input, 0..input.facets(), root, &bars)?;
    input.check()?;
    bars.clear();
    let OpenSummary { open_edges, loops, flipped_patches, .. } = summary;
    // Coordinates of a mesh have no unit of their own.
    let inside_out =
        pieces.and_then(|report| report.inside_out).map(|found| inside_out_text(&found, &path, "unit"));
    inside_out.iter().for_each(|line| warn(line));
    if args.json {
        return print_json(&json!({
            "path": path,
            "format": input.describe(),
            "bytes": input.bytes(),
            "facets": input.facets(),
            "skipped_faces": input.skipped_faces(),
            "area": area,
            "volume": (open_edges == 0).then_some(volume),
            "bounds": [min, max],
            "closed": open_edges == 0,
            "open_edges": open_edges,
            "loops": loops,
            "flipped_patches": flipped_patches,
            "pieces": pieces,
        }));
    }
    let closed = if open_edges == 0 {
        "closed".to_owned()
    } else {
        format!("open: {open_edges} open edges in {loops} loops, {flipped_patches} flipped patches")
    };
    let path = one_line(&path);
    let warning = inside_out.map_or(String::new(), |line| format!("  warning  {}\n", one_line(&line)));
    let pieces = pieces.map_or(not_told, |report| pieces_text(&report));
    let mut text =
        format!("{path}: {}, {} facets, {}\n", input.describe(), input.facets(), Size(input.bytes()));
    text +=
        &format!("  bounds   {} to {}\n  surface  {closed}\n  pieces   {pieces}\n", point(min), point(max));
    text += &match open_edges {
        0 => format!(
            "  size     area {area:.6}, volume {volume:.6}, overlaps counted as often as they are covered\n"
        ),
        _ => format!("  size     area {area:.6}; no volume, for it is open\n"),
    };
    if input.skipped_faces() > 0 {
        text += &format!("  left out {} faces of fewer than three corners\n", input.skipped_faces());
    }
    print(&(text + &warning))
}
