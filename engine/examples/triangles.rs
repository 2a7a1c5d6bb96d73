//! Triangles in memory: which points lie within, and a mesh of their union.
//!
//!     cargo run --release -p brickfield-engine --example triangles

use brickfield_engine::{Builder, Result};

/// Vertices and triangles of a cube with its lowest corner at `low`.
fn cube(low: [f64; 3], edge: f64) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let corner = |n: usize| std::array::from_fn(|a| low[a] + (n >> a & 1) as f64 * edge);
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    ((0..8).map(corner).collect(), triangles.collect())
}

fn main() -> Result<()> {
    let mut builder = Builder::new().depth(3);
    for n in 0..10 {
        let (vertices, triangles) = cube([f64::from(n) * 0.7, f64::from(n) * 0.3, 0.0], 1.0);
        builder = builder.triangles(vertices, triangles);
    }
    let octree = builder.in_memory()?;
    let points = [[0.5, 0.5, 0.5], [0.85, 0.6, 0.5], [9.0, 9.0, 9.0]];
    for (point, w) in points.iter().zip(octree.sample(&points)?) {
        println!("{point:?} lies within {w} of 10 cubes");
    }
    let mesh = octree.mesh()?;
    println!("their union has {} vertices and {} triangles", mesh.positions.len(), mesh.triangles.len());
    Ok(())
}
