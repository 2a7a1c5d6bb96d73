//! Pictures of sections of a store at equal distances.
//!
//!     cargo run --release -p brickfield-engine --example sections -- part.brf 10

use brickfield_engine::{Axis, Octree, Result};

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let octree = Octree::open(arguments.next().unwrap_or_else(|| "clover.brf".to_owned()))?;
    let count: u32 = arguments.next().and_then(|count| count.parse().ok()).unwrap_or(5);
    let (low, high) = octree.bounds();
    for n in 0..count {
        let z = low[2] + (high[2] - low[2]) * (f64::from(n) + 0.5) / f64::from(count);
        let path = format!("section-{n}.png");
        let drawn = octree.write_slice(&path, Axis::Z, z)?;
        println!("{path}: z = {z:.3}, {} × {} pixels", drawn.size[0], drawn.size[1]);
    }
    Ok(())
}
