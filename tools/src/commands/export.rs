//! `brickfield export`: levels as a volume in the format of another tool.

use super::{CACHE_BYTES, has_fractions, of_store, open_store, require_level, require_whole_samples, start};
use crate::args::{DtypeArg, ExportArgs, QuantityArg};
use crate::failure::Failure;
use crate::output::{in_line, print, print_json, require_distinct};
use crate::space::{require_space, tell_left_behind};
use crate::units::Size;
use anyhow::Context;
use brickfield_engine::Progress;
use brickfield_engine::analysis::Element;
use brickfield_engine::distance::{DistanceTree, Surface};
use brickfield_engine::export::{Format, LevelSupport, Quantity, Volume, format_of, listed_endings};
use brickfield_engine::lattice::BRICK_CELLS;
use brickfield_engine::part::directory_of;
use brickfield_engine::store::{AcceptedStores, BrickTree, Store};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A checked command line.
struct Plan<'a> {
    args: &'a ExportArgs,
    format: &'static dyn Format,
    /// The second file, of formats that have one.
    beside: Option<PathBuf>,
}

impl<'a> TryFrom<&'a ExportArgs> for Plan<'a> {
    type Error = Failure;

    fn try_from(args: &ExportArgs) -> Result<Plan<'_>, Failure> {
        let name = args.output.display();
        let Some(format) = format_of(&args.output) else {
            let endings = listed_endings();
            return Err(Failure::Usage(format!("{name}: the name of a volume ends in one of {endings}")));
        };
        if args.all_levels && format.levels() == LevelSupport::One {
            let what = format!("{name}: such a file holds one level");
            return Err(Failure::Usage(format!(
                "{what}; leave out --all-levels, or write .vdb, .vtkhdf or .zarr"
            )));
        }
        if args.quantity == QuantityArg::Sdf {
            require_takes_distances(args, format)?;
        }
        Ok(Plan { args, format, beside: format.beside().map(|ending| args.output.with_extension(ending)) })
    }
}

/// Refuses what distances cannot be written to or as.
fn require_takes_distances(args: &ExportArgs, format: &dyn Format) -> Result<(), Failure> {
    let name = args.output.display();
    let usage = |what: &str| Err(Failure::Usage(format!("{name}: {what}")));
    if !format.takes_distances() {
        return usage("such a file holds no distances; write .vdb, .zarr or .vti");
    }
    if args.all_levels {
        return usage("distances are those of one level; leave out --all-levels, or choose a --level");
    }
    match args.dtype {
        Some(DtypeArg::I2) => usage("distances are no integers; leave out --dtype i2"),
        Some(DtypeArg::F4) | None => Ok(()),
    }
}

impl Plan<'_> {
    /// The type that was asked for, or else one that holds the store's samples as they are.
    fn element(&self, store: &Store) -> Element {
        match self.args.dtype {
            _ if self.args.quantity == QuantityArg::Sdf => Element::F32,
            Some(DtypeArg::F4) => Element::F32,
            Some(DtypeArg::I2) => Element::I16,
            None if has_fractions(store) => Element::F32,
            None => self.format.element(),
        }
    }

    /// The levels to write, the finest first.
    fn levels(&self, store: &Store) -> Result<Vec<u8>, Failure> {
        let deepest = store.deepest_level();
        match self.args.level {
            Some(level) => require_level(store, level).map(|()| vec![level]),
            None if self.args.quantity == QuantityArg::Sdf => Ok(vec![deepest]),
            None if self.args.all_levels || self.format.levels() == LevelSupport::Nested => {
                Ok((0..=deepest).rev().collect())
            }
            None => Ok(vec![deepest]),
        }
    }
}

/// Runs the command.
pub fn run(args: &ExportArgs) -> Result<(), Failure> {
    let plan = Plan::try_from(args)?;
    let bars = start(args.work)?;
    let store = open_store(&args.store, CACHE_BYTES, args.io, AcceptedStores::Whole)?;
    let (levels, element) = (plan.levels(&store)?, plan.element(&store));
    let outputs = [&args.output].into_iter().chain(&plan.beside).map(PathBuf::as_path).collect::<Vec<_>>();
    require_distinct(&outputs, &[&args.store])?;
    tell_left_behind(&args.output, args.work.quiet);
    plan.format.require_writable(&args.output)?;
    let quantity = match args.quantity {
        QuantityArg::W => Quantity::Winding,
        QuantityArg::Sdf => Quantity::Distance,
    };
    let surface = (quantity == Quantity::Distance).then(|| surface_of(args, &store, &bars)).transpose()?;
    let band = |surface| DistanceTree::new(&store, surface, levels[0], &bars);
    let distances = surface.as_ref().map(band).transpose()?;
    let description = describe(&plan, &store, &levels, element);
    let text = serde_json::to_string_pretty(&description).context("cannot write JSON")? + "\n";
    let volume = Volume {
        tree: distances.as_ref().map_or(&store, |tree| tree as &dyn BrickTree),
        levels,
        quantity,
        element,
        name: if quantity == Quantity::Distance { "distance" } else { "w" },
        unit: Some(store.meta().unit.as_str()).filter(|unit| *unit != "unit"),
        description: &text,
    };
    let bytes = plan.format.bytes_about(&volume).try_into().unwrap_or(u64::MAX);
    require_space(&args.output, bytes, "choose a lower --level")?;
    let written = plan.format.write(&volume, &args.output, &bars);
    written.map_err(|error| of_store(&store, "levels", error))?;
    bars.clear();
    if args.json {
        print_json(&description)
    } else if args.work.quiet {
        Ok(())
    } else {
        let (name, axis, dtype) = (in_line(&args.output), volume.axis(), element.numpy());
        let coarser = match volume.levels.len() {
            1 => String::new(),
            levels => format!(", with {} coarser levels", levels - 1),
        };
        print(&format!("{name}: {axis} × {axis} × {axis} {dtype}{coarser}, {}", Size(size(&args.output))))
    }
}

/// The surface that distances are counted from.
fn surface_of(args: &ExportArgs, store: &Store, progress: &dyn Progress) -> Result<Surface, Failure> {
    require_whole_samples(store, "distances cannot be told")?;
    Ok(Surface::new(store, CACHE_BYTES, directory_of(&args.output), progress)?)
}

/// Bytes of a file, or of all files in a folder.
fn size(path: &Path) -> u64 {
    match std::fs::read_dir(path) {
        Ok(entries) => entries.flatten().map(|entry| size(&entry.path())).sum(),
        Err(_) => std::fs::metadata(path).map_or(0, |file| file.len()),
    }
}

fn describe(plan: &Plan<'_>, store: &Store, levels: &[u8], element: Element) -> Value {
    let axis = BRICK_CELLS << levels[0];
    let root = store.root();
    json!({
        "array": plan.args.output.file_name().map(|name| name.to_string_lossy().into_owned()),
        "store": plan.args.store.display().to_string(),
        "level": levels[0],
        "levels": levels,
        "quantity": if plan.args.quantity == QuantityArg::Sdf { "distance" } else { "w" },
        "order": "zyx",
        "shape": [axis, axis, axis],
        "dtype": element.numpy(),
        "origin": root.to_world([1.0; 3]),
        "spacing": root.spacing(levels[0]),
        "unit": store.meta().unit,
        // As it was called before.
        "units": store.meta().unit,
    })
}
