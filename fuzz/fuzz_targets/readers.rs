//! Any bytes as a file for the reader that `READER` names. One program for all readers: each has the whole engine in it.
#![no_main]

use brickfield_engine::fuzz::{TARGETS, Target, target};
use std::sync::LazyLock;

static READER: LazyLock<Target> = LazyLock::new(|| {
    let name = std::env::var("READER").unwrap_or_default();
    target(&name).unwrap_or_else(|| {
        let names = TARGETS.map(|(known, _)| known).join(", ");
        eprintln!("READER=\"{name}\" is none of {names}");
        std::process::exit(2);
    })
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| READER(bytes));
