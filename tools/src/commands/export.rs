//! `brickfield export`: a level as a NumPy array with a description beside it.

use super::{CACHE_BYTES, of_store, open_store, require_level, start};
use crate::args::{DtypeArg, ExportArgs};
use crate::failure::Failure;
use crate::npy;
use crate::output::{in_line, print, print_json, require_distinct};
use crate::units::Size;
use anyhow::Context;
use brickfield_engine::Progress;
use brickfield_engine::analysis::{Dense, Element};
use brickfield_engine::part::{PartFile, PartPair};
use brickfield_engine::store::{Accept, Store};
use serde_json::{Value, json};
use std::path::PathBuf;

/// A checked command line.
struct Plan<'a> {
    args: &'a ExportArgs,
    element: Element,
    dtype: &'static str,
    description: PathBuf,
}

impl<'a> TryFrom<&'a ExportArgs> for Plan<'a> {
    type Error = Failure;

    fn try_from(args: &ExportArgs) -> Result<Plan<'_>, Failure> {
        if args.output.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("npy")) {
            let name = args.output.display();
            return Err(Failure::Usage(format!("{name}: the array's name must end in .npy")));
        }
        let (element, dtype) = match args.dtype {
            DtypeArg::I2 => (Element::I16, "<i2"),
            DtypeArg::F4 => (Element::F32, "<f4"),
        };
        Ok(Plan { args, element, dtype, description: args.output.with_extension("json") })
    }
}

/// Runs the command.
pub fn run(args: &ExportArgs) -> Result<(), Failure> {
    let plan = Plan::try_from(args)?;
    let bars = start(args.work)?;
    let store = open_store(&args.store, CACHE_BYTES, args.io, Accept::Whole)?;
    require_level(&store, args.level)?;
    require_distinct(&[&args.output, &plan.description], &[&args.store])?;
    let grid =
        Dense::new(&store, args.level, plan.element).map_err(|error| of_store(&store, "levels", error))?;
    let description = describe(&plan, &store, &grid);
    let mut pair = PartPair::create(&args.output, &plan.description)?;
    write_array(&plan, &grid, &pair.file, &bars)?;
    let json = serde_json::to_string_pretty(&description).context("cannot write JSON")?;
    pair.description.append(format!("{json}\n").as_bytes())?;
    pair.finish()?;
    bars.clear();
    if args.json {
        print_json(&description)
    } else if args.work.quiet {
        Ok(())
    } else {
        let (name, axis) = (in_line(&args.output), grid.axis());
        let size = Size(grid.bytes().try_into().unwrap_or(u64::MAX));
        print(&format!("{name}: {axis} × {axis} × {axis} {}, {size}", plan.dtype))
    }
}

fn describe(plan: &Plan<'_>, store: &Store, grid: &Dense<'_>) -> Value {
    json!({
        "array": plan.args.output.file_name().map(|name| name.to_string_lossy().into_owned()),
        "store": plan.args.store.display().to_string(),
        "level": plan.args.level,
        "order": "zyx",
        "shape": [grid.axis(), grid.axis(), grid.axis()],
        "dtype": plan.dtype,
        "origin": grid.origin(),
        "spacing": grid.spacing(),
        "units": store.meta().unit,
    })
}

fn write_array(
    plan: &Plan<'_>,
    grid: &Dense<'_>,
    array: &PartFile,
    progress: &dyn Progress,
) -> Result<(), Failure> {
    let header = npy::header(plan.dtype, grid.axis());
    array.write_at(&header, 0)?;
    Ok(grid.write(progress, &|offset, bytes| array.write_at(bytes, header.len() as u64 + offset))?)
}
