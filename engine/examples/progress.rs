//! A build that tells how far it is, and that is stopped half way. The same build goes on from there.
//!
//!     cargo run --release -p brickfield-engine --example progress -- part.gcode

use brickfield_engine::{Builder, ErrorKind, Progress, Result};
use std::sync::atomic::{AtomicU64, Ordering};

/// Tells phases, and stops after so many steps of the build.
struct Patience {
    steps: AtomicU64,
    most: u64,
}

impl Progress for Patience {
    fn phase(&self, name: &str, total: Option<u64>, unit: &str) {
        self.steps.store(0, Ordering::Relaxed);
        match total {
            Some(total) => println!("{name}: {total} {unit}"),
            None => println!("{name}"),
        }
    }

    fn advance(&self, steps: u64) {
        self.steps.fetch_add(steps, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.steps.load(Ordering::Relaxed) > self.most
    }
}

fn main() -> Result<()> {
    let toolpath = std::env::args().nth(1).unwrap_or_else(|| "bench-data/clover.gcode".to_owned());
    for most in [100, u64::MAX] {
        let patience = Patience { steps: AtomicU64::new(0), most };
        match Builder::new().file(&toolpath).depth(4).progress(&patience).write("progress.brf") {
            Ok(octree) => println!("done: {:.0} {}³", octree.volumes()?.union, octree.unit()),
            Err(error) if error.kind() == ErrorKind::Interrupted => println!("{error}"),
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
