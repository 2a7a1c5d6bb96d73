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
use brickfield_engine::ingest::OpenOptions;
use brickfield_engine::lattice::RootCube;
use serde_json::{Value, json};
use std::path::Path;

/// Extrusions that are named for people; `--json` names all.
const NAMED: usize = 20;

/// Runs the command.
pub fn run(file: &Path, args: &InfoArgs) -> Result<(), Failure> {
    let bars = start(WorkArgs { threads: None, quiet: args.json, progress: ProgressArg::Auto })?;
    let inputs = open_inputs(&[file.to_owned()], &[], &OpenOptions::default(), &bars)?;
    let input = &inputs[0];
    let path = input.path().display().to_string();
    let Some(sweeps) = input.sweeps() else {
        return Err(anyhow!("{path}: is no X3D file any more; leave the file alone while it is read").into());
    };
    let (min, max) = input.bounds(&bars)?;
    let root = RootCube::around(min, max).ok_or_else(|| {
        anyhow!("{path}: bounds: it spans {min:?} to {max:?}, which fits no lattice; give it an extent")
    })?;
    bars.phase("measuring", Some(input.facets()), "facets");
    let mut shapes = Vec::new();
    let (mut area, mut volume, mut open) = (0.0, 0.0, 0);
    for shape in sweeps.shapes() {
        let measures = measure(input, shape.facets.clone(), root, &bars)?;
        area += measures.area;
        volume += measures.volume;
        open += u64::from(!measures.closed);
        shapes.push((shape, measures));
    }
    input.check()?;
    bars.clear();
    if args.json {
        let shape = |(shape, m): &(brickfield_engine::x3d::Shape<'_>, Measures)| -> Value {
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
        return print_json(&json!({
            "path": path,
            "format": input.describe(),
            "bytes": input.bytes(),
            "facets": input.facets(),
            "bounds": [min, max],
            "closed": open == 0,
            "area": area,
            "volume": (open == 0).then_some(volume),
            "extrusions": sweeps.report().extrusions,
            "shapes": shapes.iter().map(shape).collect::<Vec<_>>(),
            "warnings": input.warnings(),
        }));
    }
    let counts = format!("{} Extrusions shown, {} facets", shapes.len(), input.facets());
    let mut text = format!("{}: X3D, {counts}, {}\n", one_line(&path), Size(input.bytes()));
    text += &format!("  bounds   {} to {}\n", point(min), point(max));
    text += &match open {
        0 => "  surface  closed\n".to_owned(),
        _ => format!("  surface  open: {open} of the Extrusions are\n"),
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
    print(&text)
}
