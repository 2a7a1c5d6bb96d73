//! `brickfield verify`: is a store sound?

use super::{CACHE_BYTES, open_store, start};
use crate::args::VerifyArgs;
use crate::failure::Failure;
use crate::output::{in_line, print, print_json};
use crate::units::Size;
use brickfield_engine::store::{AcceptedStores, Damage, VerifyReport};
use serde_json::json;

/// Runs the command.
pub fn run(args: &VerifyArgs) -> Result<(), Failure> {
    let bars = start(args.work)?;
    let store = open_store(&args.store, CACHE_BYTES, args.io, AcceptedStores::Unfinished)?;
    let shard = store.meta().shard.as_ref().map(|shard| shard.id);
    let report = store.verify(&bars)?;
    bars.clear();
    if args.json {
        let damage = |Damage { key, offset, what }: &Damage| json!({ "record": key.map(|key| key.to_string()), "offset": offset, "what": what });
        print_json(&json!({
            "path": args.store.display().to_string(),
            "sound": report.damaged == 0 && report.strays == 0,
            "unfinished": store.is_unfinished(),
            "shard": shard,
            "records": report.records,
            "payload_bytes": report.payload_bytes,
            "damaged": report.damaged,
            "strays": report.strays,
            "first_damage": report.first_damage.as_ref().map(damage),
        }))?;
    }
    let VerifyReport { records, payload_bytes, .. } = report.into_result(&store)?;
    if args.json || args.work.quiet {
        return Ok(());
    }
    let path = in_line(&args.store);
    let unfinished = if store.is_unfinished() { " so far, unfinished" } else { "" };
    let shard = shard.map_or(String::new(), |shard| format!(", shard {shard}"));
    print(&format!(
        "{path}: sound{unfinished}{shard}, {records} records with {} of payload",
        Size(payload_bytes)
    ))
}
