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
use brickfield_engine::build::{Measures, measure};
use brickfield_engine::ingest::{Facets, Input, OpenOptions};
use brickfield_engine::lattice::RootCube;
use brickfield_engine::pieces::{Consistency, PiecesReport, study};
use brickfield_engine::winding::{OpenPart, OpenSummary};
use brickfield_engine::{Error, Progress};
use serde_json::{Value, json};
use std::path::Path;

/// What is told of a mesh.
struct MeshInfo<'a> {
    input: &'a Input,
    path: String,
    bounds: ([f64; 3], [f64; 3]),
    measures: Measures,
    summary: OpenSummary,
    /// How many pieces there are, or why that is not told.
    pieces: Result<PiecesReport, String>,
}

/// Runs the command.
pub fn run(file: &Path, args: &InfoArgs) -> Result<(), Failure> {
    let bars = start(WorkArgs { threads: args.threads, quiet: args.json, progress: ProgressArg::Auto })?;
    let inputs = open_inputs(&[file.to_owned()], &[], &OpenOptions::default(), &bars)?;
    let input = &inputs[0];
    let path = input.path().display().to_string();
    let bounds = input.bounds(&bars)?;
    let root = RootCube::around(bounds.0, bounds.1).ok_or_else(|| {
        let (min, max) = bounds;
        anyhow!(
            "{path}: bounds: the input spans {min:?} to {max:?}, which fits no lattice; give it an extent"
        )
    })?;
    let memory = memory::budget(None).map_or(u64::MAX, |size| size.0);
    let pieces = match study(&[input as &dyn Facets], root, Consistency::Given, memory, &bars) {
        Ok((report, _)) => Ok(report),
        Err(Error::Setting { what, .. }) => Err(what),
        Err(error) => return Err(error.into()),
    };
    bars.phase("measuring", Some(input.facets()), "facets");
    let measures = measure(input, 0..input.facets(), root, &bars)?;
    let summary = match measures.closed {
        true => OpenSummary::default(),
        false => OpenPart::of(&[input], root, &bars)?.summary,
    };
    input.check()?;
    bars.clear();
    let told = MeshInfo { input, path, bounds, measures, summary, pieces };
    let warning = told.warning();
    warning.iter().for_each(|line| warn(line));
    if args.json {
        return print_json(&told.json());
    }
    let warning = warning.map_or(String::new(), |line| format!("  warning  {}\n", one_line(&line)));
    print(&(told.text() + &warning))
}

impl MeshInfo<'_> {
    fn is_closed(&self) -> bool {
        self.summary.open_edges == 0
    }

    /// The piece that is inside out, if there is one.
    fn warning(&self) -> Option<String> {
        let found = self.pieces.as_ref().ok()?.inside_out.as_ref()?;
        // Coordinates of a mesh have no unit of their own.
        Some(inside_out_text(found, &self.path, "unit"))
    }

    fn json(&self) -> Value {
        let MeshInfo { input, path, bounds, measures, summary, pieces } = self;
        json!({
            "path": path,
            "format": input.describe(),
            "bytes": input.bytes(),
            "facets": input.facets(),
            "skipped_faces": input.skipped_faces(),
            "area": measures.area,
            "volume": self.is_closed().then_some(measures.volume),
            "bounds": [bounds.0, bounds.1],
            "closed": self.is_closed(),
            "open_edges": summary.open_edges,
            "loops": summary.loops,
            "flipped_patches": summary.flipped_patches,
            "pieces": pieces.as_ref().ok(),
        })
    }

    fn text(&self) -> String {
        let MeshInfo { input, path, bounds, measures, summary, pieces } = self;
        let (Measures { area, volume, .. }, (min, max)) = (*measures, *bounds);
        let OpenSummary { open_edges, loops, flipped_patches, .. } = *summary;
        let (surface, size) = match self.is_closed() {
            true => (
                "closed".to_owned(),
                format!("area {area:.6}, volume {volume:.6}, overlaps counted as often as they are covered"),
            ),
            false => (
                format!("open: {open_edges} open edges in {loops} loops, {flipped_patches} flipped patches"),
                format!("area {area:.6}; no volume, for it is open"),
            ),
        };
        let pieces = pieces.as_ref().map_or_else(String::clone, pieces_text);
        let (name, bytes) = (one_line(path), Size(input.bytes()));
        let mut text = format!("{name}: {}, {} facets, {bytes}\n", input.describe(), input.facets());
        text += &format!("  bounds   {} to {}\n", point(min), point(max));
        text += &format!("  surface  {surface}\n  pieces   {pieces}\n  size     {size}\n");
        if input.skipped_faces() > 0 {
            text += &format!("  left out {} faces of fewer than three corners\n", input.skipped_faces());
        }
        text
    }
}
