//! `brickfield info` of a volume that another tool wrote.

use crate::args::InfoArgs;
use crate::failure::Failure;
use crate::output::{in_line, print, print_json};
use brickfield_engine::import::Grid;
use serde_json::json;
use std::path::Path;

/// Says where the samples of a volume lie and what they are.
pub(super) fn run(file: &Path, args: &InfoArgs) -> Result<(), Failure> {
    if args.volume {
        let what = format!("--volume takes a store; {} is a volume: build it first", in_line(file));
        return Err(Failure::Usage(what));
    }
    let grid = Grid::open(file, None)?;
    let ([x, y, z], origin, spacing) = (grid.shape(), grid.origin(), grid.spacing());
    let last: [f64; 3] = std::array::from_fn(|a| origin[a] + (grid.shape()[a] - 1) as f64 * spacing);
    let values = if grid.holds_distances() { "distances" } else { "winding numbers or grey values" };
    if args.json {
        return print_json(&json!({
            "file": file.display().to_string(),
            "format": grid.format(),
            "shape": [z, y, x],
            "type": grid.type_name(),
            "fields": grid.fields(),
            "note": grid.note(),
            "holds_distances": grid.holds_distances(),
            "spacing": spacing,
            "origin": origin,
            "last": last,
            "unit": grid.unit(),
        }));
    }
    let solid = if grid.holds_distances() {
        "solid is what lies below 0"
    } else {
        "solid is 0.5 and more, or what --threshold says; --volume-as sdf: below 0"
    };
    let unit = grid.unit().unwrap_or("units");
    let place = |p: [f64; 3]| format!("({:.6}, {:.6}, {:.6})", p[0], p[1], p[2]);
    let fields = grid.fields().iter().enumerate().map(|(n, field)| match n {
        0 => format!("\n  field    {field}"),
        _ => format!("\n  or       {field}"),
    });
    let note = grid.note().map(|note| format!("\n  note     {note}"));
    let more: String = fields.chain(note).collect();
    print(&format!(
        "{}: {}{more}\n  samples  {x} × {y} × {z} of type {}, {values}\n  spacing  {spacing} {unit}\n  samples  from {} to {}\n  \
         build    `brickfield build` takes it: {solid}",
        in_line(file),
        grid.format(),
        grid.type_name(),
        place(origin),
        place(last)
    ))
}
