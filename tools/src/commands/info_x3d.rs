//! `brickfield info` of an X3D file: its Extrusions, one by one.

use super::info::point;
use super::{open_inputs, start};
use crate::args::InfoArgs;
use crate::failure::Failure;
use crate::output::{one_line, print, print_json};
use crate::units::Size;
use crate::work::{ProgressArg, WorkArgs};
use anyhow::anyhow;
use brickfield_engine::Progress;
use brickfield_engine::build::{Measures, measure};
use brickfield_engine::ingest::{Input, OpenOptions};
use brickfield_engine::lattice::RootCube;
use brickfield_engine::x3d::PlacedExtrusion;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::Path;

/// Extrusions that are named for people; `--json` names all.
const NAMED: usize = 20;

/// Runs the command.
pub fn run(file: &Path, args: &InfoArgs) -> Result<(), Failure> {
    let bars = start(WorkArgs { threads: args.threads, quiet: args.json, progress: ProgressArg::Auto })?;
    let inputs = open_inputs(&[file.to_owned()], &[], &OpenOptions::default(), &bars)?;
    let input = &inputs[0];
    let path = input.path().display().to_string();
    let Some(sweeps) = input.sweeps() else {
        return Err(anyhow!("{path}: is no X3D file any more; leave the file alone while it is read").into());
    };
    let bounds = input.bounds(&bars)?;
    let root = RootCube::around(bounds.0, bounds.1).ok_or_else(|| {
        let (min, max) = bounds;
        anyhow!("{path}: bounds: it spans {min:?} to {max:?}, which fits no lattice; give it an extent")
    })?;
    bars.phase("measuring", Some(input.facets()), "facets");
    let mut shapes = Vec::new();
    for shape in sweeps.shapes() {
        let measures = measure(input, shape.facets.clone(), root, &bars)?;
        shapes.push((shape, measures));
    }
    input.check()?;
    bars.clear();
    let told = X3dInfo { input, path, bounds, shapes };
    if args.json { print_json(&told.json(sweeps.report().extrusions)) } else { print(&told.text()) }
}

/// What is told of an X3D file.
struct X3dInfo<'a> {
    input: &'a Input,
    path: String,
    bounds: ([f64; 3], [f64; 3]),
    shapes: Vec<(PlacedExtrusion<'a>, Measures)>,
}

impl X3dInfo<'_> {
    /// Area and volume of all Extrusions.
    fn sums(&self) -> (f64, f64) {
        let add = |(area, volume), (_, m): &(_, Measures)| (area + m.area, volume + m.volume);
        self.shapes.iter().fold((0.0, 0.0), add)
    }

    /// How many of them are open.
    fn open(&self) -> usize {
        self.shapes.iter().filter(|(_, measures)| !measures.closed).count()
    }

    fn json(&self, extrusions: impl Serialize) -> Value {
        let X3dInfo { input, path, bounds, shapes } = self;
        let (area, volume) = self.sums();
        let is_closed = self.open() == 0;
        let shape = |(shape, m): &(PlacedExtrusion<'_>, Measures)| -> Value {
            json!({
                "def": shape.def,
                "line": shape.line,
                "facets": shape.facets.end - shape.facets.start,
                "closed": m.closed,
                "area": m.area,
                "volume": m.closed.then_some(m.volume),
                "bounds": [m.bounds.0, m.bounds.1],
            })
        };
        json!({
            "path": path,
            "format": input.describe(),
            "bytes": input.bytes(),
            "facets": input.facets(),
            "bounds": [bounds.0, bounds.1],
            "closed": is_closed,
            "area": area,
            "volume": is_closed.then_some(volume),
            "extrusions": extrusions,
            "shapes": shapes.iter().map(shape).collect::<Vec<_>>(),
            "warnings": input.warnings(),
        })
    }

    fn text(&self) -> String {
        let X3dInfo { input, path, bounds: (min, max), shapes } = self;
        let (area, volume) = self.sums();
        let counts = format!("{} Extrusions shown, {} facets", shapes.len(), input.facets());
        let mut text = format!("{}: X3D, {counts}, {}\n", one_line(path), Size(input.bytes()));
        text += &format!("  bounds   {} to {}\n", point(*min), point(*max));
        text += &match self.open() {
            0 => "  surface  closed\n".to_owned(),
            open => format!("  surface  open: {open} of the Extrusions are\n"),
        };
        text += &format!(
            "  size     area {area:.6}, volume {volume:.6}, overlaps counted as often as they are covered\n"
        );
        for (shape, measures) in shapes.iter().take(NAMED) {
            let name = shape.def.map_or_else(String::new, |def| format!(" {}:", one_line(def)));
            let closed = if measures.closed { "closed" } else { "open" };
            let facets = shape.facets.end - shape.facets.start;
            let (low, high) = measures.bounds;
            text += &format!(
                "  line {}:{name} {facets} facets, {closed}, volume {:.6}, {} to {}\n",
                shape.line,
                measures.volume,
                point(low),
                point(high)
            );
        }
        if shapes.len() > NAMED {
            text += &format!("  and {} more (--json names all)\n", shapes.len() - NAMED);
        }
        text
    }
}
