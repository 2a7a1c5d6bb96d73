//! A scan, points with normals, as a closed mesh.
//!
//!     cargo run --release -p brickfield-engine --example scan -- scan.ply scan.stl
//!
//! Without a file, points of a sphere.

use brickfield_engine::{Builder, Result};

/// Points of a sphere, evenly spread along a spiral, and their normals.
fn sphere(count: usize) -> (Vec<[f64; 3]>, Vec<[f64; 3]>) {
    let normals = (0..count).map(|n| {
        let z = 1.0 - (2 * n + 1) as f64 / count as f64;
        let (sin, cos) = (n as f64 * 2.399_963).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        [radius * cos, radius * sin, z]
    });
    let normals: Vec<[f64; 3]> = normals.collect();
    (normals.iter().map(|normal| normal.map(|c| 10.0 * c)).collect(), normals)
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let builder = match arguments.next() {
        Some(scan) => Builder::new().file(scan),
        None => {
            let (points, normals) = sphere(2000);
            Builder::new().points(points, normals)
        }
    };
    let mesh = arguments.next().unwrap_or_else(|| "scan.stl".to_owned());
    let summary = builder.in_memory()?.write_mesh(&mesh)?;
    println!(
        "{mesh}: {} triangles, area {:.1}, volume {:.1}",
        summary.triangles, summary.area, summary.volume
    );
    Ok(())
}
