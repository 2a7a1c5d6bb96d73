//! `brickfield offset`: a part grown, shrunk or hollowed, as a store.

use super::{no_unit, of_store, open_store, require_whole_samples, start, unit_of};
use crate::distance_args::OffsetArgs;
use crate::failure::Failure;
use crate::output::{in_line, print, print_json, require_distinct};
use brickfield_engine::distance::Surface;
use brickfield_engine::distance::offset::{Solid, offset};
use brickfield_engine::part::directory_of;
use brickfield_engine::store::{AcceptedStores, check_target};
use serde_json::json;

/// Runs the command.
pub fn run(args: &OffsetArgs) -> Result<(), Failure> {
    let bars = start(args.work)?;
    let store = open_store(&args.store, args.surface.memory.0 / 8, args.surface.io, AcceptedStores::Whole)?;
    require_distinct(&[&args.output], &[&args.store])?;
    require_whole_samples(&store, "it has no exact surface to grow")?;
    check_target(&args.output)?;
    let unit = &store.meta().unit;
    let by = args.by.map(|by| by.in_unit_of(unit).ok_or_else(no_unit)).transpose()?;
    if args.sharp && by.is_some_and(|by| by <= 0.0) {
        return Err(Failure::Usage(
            "--sharp is for lengths outward: shrinking keeps edges sharp without it".to_owned(),
        ));
    }
    let solid = match (by, args.shell) {
        (_, Some(shell)) => Solid::Shell(shell.in_unit_of(unit).ok_or_else(no_unit)?),
        (Some(by), None) if args.sharp => Solid::Mitred(by, args.mitre_limit),
        (Some(by), None) => Solid::Offset(by),
        (None, None) => return Err(Failure::Usage("give a length with --by or --shell".to_owned())),
    };
    let folder = args.surface.temp_dir.as_deref().unwrap_or(directory_of(&args.output));
    // Pieces of a surface come and go in all sizes on all threads, which costs the allocator a third more than they have.
    let surface = Surface::new(&store, args.surface.memory.0 / 4, folder, &bars)?;
    let stats = offset(&store, &surface, solid, &args.output, &bars);
    let stats = stats.map_err(|error| of_store(&store, "offset", error))?;
    bars.clear();
    let (what, length) = (solid.name(), solid.length());
    if args.json {
        return print_json(&json!({
            "unit": unit,
            "cell": surface.cell(),
            "by": if args.shell.is_none() { json!(length) } else { json!(null) },
            "shell": if args.shell.is_some() { json!(length) } else { json!(null) },
            "mitre_limit": if args.sharp { json!(args.mitre_limit) } else { json!(null) },
            "nodes": stats.nodes,
            "leaves": stats.leaves,
            "file_bytes": stats.file_bytes,
        }));
    }
    if args.work.quiet {
        return Ok(());
    }
    let name = in_line(&args.output);
    print(&format!("{name}: {what} {length} {}, {} nodes", unit_of(store.meta()), stats.nodes))
}
