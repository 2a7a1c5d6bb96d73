//! Whole files: the reference cases, the clover, and what the hierarchy does.

mod cases;
mod hostile;
mod scenes;
mod sweeps;
mod written;

use super::{Extrusion, Sweeps, X3dItem, X3dReport, read};
use crate::error::Result;
use crate::progress::Silent;
use glam::{DAffine3, DVec3};
use std::collections::BTreeMap;
use std::path::Path;

type Triangle = [[f64; 3]; 3];

/// A scene in the XML of a file.
fn file(scene: &str) -> String {
    format!("<?xml version='1.0'?>\n<X3D version='3.3'><head/><Scene>\n{scene}\n</Scene></X3D>\n")
}

fn opened(text: &str) -> Result<Sweeps> {
    Sweeps::read(Path::new("a.x3d"), text.as_bytes(), &Silent)
}

/// Sweeps of a scene that can be read.
fn sweeps(scene: &str) -> Sweeps {
    opened(&file(scene)).unwrap()
}

/// What is said about a text that cannot be read.
fn refusal(text: &str) -> String {
    let told = opened(text).expect_err("was read").to_string();
    assert!(!told.contains('\n'), "more than one line: {told}");
    told
}

fn all(sweeps: &Sweeps) -> Vec<Triangle> {
    let mut out = Vec::new();
    sweeps.append(0..sweeps.facets(), &mut out);
    assert_eq!(out.len() as u64, sweeps.facets());
    out
}

/// Volume within, positive for outward triangles.
fn volume(triangles: &[Triangle]) -> f64 {
    triangles.iter().map(|t| t.map(DVec3::from)).map(|[a, b, c]| a.dot(b.cross(c))).sum::<f64>() / 6.0
}

fn area(triangle: &Triangle) -> f64 {
    let [a, b, c] = triangle.map(DVec3::from);
    (b - a).cross(c - a).length() / 2.0
}

fn bounds(triangles: &[Triangle]) -> [DVec3; 2] {
    let corners = triangles.as_flattened().iter().map(|c| DVec3::from(*c));
    corners.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], c| [low.min(c), high.max(c)])
}

/// Directed edges without a reverse, corners being equal if their bits are.
fn open_edges(triangles: &[Triangle]) -> usize {
    let mut edges: BTreeMap<[[u64; 3]; 2], i64> = BTreeMap::new();
    for triangle in triangles {
        let corners = triangle.map(|corner| corner.map(|c| (c + 0.0).to_bits()));
        for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (corners[i], corners[j])) {
            if from < to {
                *edges.entry([from, to]).or_default() += 1;
            } else if to < from {
                *edges.entry([to, from]).or_default() -= 1;
            }
        }
    }
    edges.values().map(|times| times.unsigned_abs() as usize).sum()
}

/// Everything that a text hands over.
#[derive(Debug, Default)]
struct Pieces {
    extrusions: Vec<Extrusion>,
    places: Vec<(u64, DAffine3)>,
    report: X3dReport,
}

fn pieces(scene: &str) -> Pieces {
    let mut pieces = Pieces::default();
    let report = read(Path::new("a.x3d"), file(scene).as_bytes(), &Silent, &mut |piece| {
        match piece {
            X3dItem::Extrusion(extrusion) => pieces.extrusions.push(extrusion.clone()),
            X3dItem::Place { extrusion, to_scene } => pieces.places.push((extrusion, to_scene)),
        }
        Ok(())
    });
    pieces.report = report.unwrap();
    pieces
}
