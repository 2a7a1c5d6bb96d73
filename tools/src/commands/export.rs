//! `brickfield export`: a level as a NumPy array with a description beside it.

use super::{CACHE_BYTES, has_fractions, of_store, open_store, require_level, start};
use crate::args::{DtypeArg, ExportArgs};
use crate::failure::Failure;
use crate::npy;
use crate::output::{in_line, print, print_json, require_distinct};
use crate::space::{require_space, tell_left_behind};
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
    description: PathBuf,
}

impl<'a> TryFrom<&'a ExportArgs> for Plan<'a> {
    type Error = Failure;

    fn try_from(args: &ExportArgs) -> Result<Plan<'_>, Failure> {
        if args.output.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("npy")) {
            let name = args.output.display();
            return Err(Failure::Usage(format!("{name}: the array's name must end in .npy")));
        }
        Ok(Plan { args, description: args.output.with_extension("json") })
    }
}

/// The elements that were asked for, or else those that hold the store's samples as they are.
fn elements(asked: Option<DtypeArg>, store: &Store) -> (Element, &'static str) {
    match asked {
        Some(DtypeArg::F4) => (Element::F32, "<f4"),
        None if has_fractions(store) => (Element::F32, "<f4"),
        Some(DtypeArg::I2) | None => (Element::I16, "<i2"),
    }
}

/// Runs the command.
pub fn run(args: &ExportArgs) -> Result<(), Failure> {
    let plan = Plan::try_from(args)?;
    let bars = start(args.work)?;
    let store = open_store(&args.store, CACHE_BYTES, args.io, Accept::Whole)?;
    require_level(&store, args.level)?;
    require_distinct(&[&args.output, &plan.description], &[&args.store])?;
    let (element, dtype) = elements(args.dtype, &store);
    let grid = Dense::new(&store, args.level, element).map_err(|error| of_store(&store, "levels", error))?;
    let description = describe(&plan, &store, &grid, dtype);
    tell_left_behind(&args.output, args.work.quiet);
    let bytes = grid.bytes().try_into().unwrap_or(u64::MAX);
    require_space(&args.output, bytes, "choose a lower --level")?;
    let mut pair = PartPair::create(&args.output, &plan.description)?;
    write_array(dtype, &grid, &pair.file, &bars)?;
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
        print(&format!("{name}: {axis} × {axis} × {axis} {dtype}, {size}"))
    }
}

fn describe(plan: &Plan<'_>, store: &Store, grid: &Dense<'_>, dtype: &str) -> Value {
    json!({
        "array": plan.args.output.file_name().map(|name| name.to_string_lossy().into_owned()),
        "store": plan.args.store.display().to_string(),
        "level": plan.args.level,
        "order": "zyx",
        "shape": [grid.axis(), grid.axis(), grid.axis()],
        "dtype": dtype,
        "origin": grid.origin(),
        "spacing": grid.spacing(),
        "unit": store.meta().unit,
        // As it was called before.
        "units": store.meta().unit,
    })
}

fn write_array(
    dtype: &str,
    grid: &Dense<'_>,
    array: &PartFile,
    progress: &dyn Progress,
) -> Result<(), Failure> {
    let header = npy::header(dtype, grid.axis());
    array.write_at(&header, 0)?;
    Ok(grid.write(progress, &|offset, bytes| array.write_at(bytes, header.len() as u64 + offset))?)
}
