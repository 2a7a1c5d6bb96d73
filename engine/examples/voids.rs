//! The largest voids of a store, each with its size and place.
//!
//!     cargo run --release -p brickfield-engine --example voids -- part.brf

use brickfield_engine::voids::{VoidOptions, find};
use brickfield_engine::{Error, Octree, Result, Silent};

fn main() -> Result<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "clover.brf".to_owned());
    let octree = Octree::open(path)?;
    let store = octree.store().ok_or_else(|| Error::setting("the octree is no store", "write it"))?;
    let found = find(store, &VoidOptions::default(), &Silent)?;
    let porosity = found.porosity();
    println!(
        "{} voids, porosity {:.3} ± {:.3} %",
        found.voids.len(),
        100.0 * porosity.value,
        100.0 * porosity.error
    );
    for void in found.voids.iter().take(10) {
        let [x, y, z] = void.centroid;
        println!("{}: {:.3} ± {:.3} at {x:.2} {y:.2} {z:.2}", void.id, void.volume, void.volume_error);
    }
    Ok(())
}
