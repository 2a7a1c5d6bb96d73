//! Meshes against the truth: how far surfaces are from the boundary of the union, both ways, and what they enclose.

use super::{Kept, Soup, at_depth, contoured, file, meshed, root_of};
use brickfield_bench_data::judge::boundary::Union;
use brickfield_bench_data::judge::distance::{
    DistanceQuery, DistanceStatistics, MeshComparison, TriangleSource, compare,
};
use brickfield_bench_data::pile::sharp_part;
use brickfield_bench_data::shapes::{cuboid, spiral_tube};
use brickfield_bench_data::{Mesh, StlFacet};
use brickfield_core::sweep::part_or_all;
use brickfield_engine::Silent;
use brickfield_engine::build::build_in_memory;
use brickfield_engine::contour::{ContourOptions, contour};

/// How far the mesh of a soup at a depth, and with a tolerance in cells, is from the soup's union; in cells.
fn off(name: &str, soup: &Soup, depth: u8, cells: f64) -> MeshComparison {
    let root = root_of(soup);
    let cell = root.spacing(depth);
    let tree = build_in_memory(&[soup], root, at_depth(depth)).unwrap_or_else(|e| panic!("{e}"));
    let mut kept = Kept::default();
    let options = ContourOptions { tolerance: cells * cell, ..Default::default() };
    contour(&tree, &options, &mut kept, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let told = in_cells(compared(soup, kept, cell, 10_000), cell);
    println!("{name} at depth {depth}, tolerance {cells} cells: {told:?}");
    told
}

/// The distance of a mesh and the boundary of a soup's union, by so many samples each way.
pub fn compared(soup: &Soup, mesh: Kept, cell: f64, samples: u64) -> MeshComparison {
    let single = |facet: &[[f64; 3]; 3]| -> StlFacet { facet.map(|v| v.map(|c| c as f32)) };
    let asked = DistanceQuery {
        samples,
        crease_samples: samples,
        crease_degrees: 20.0,
        seed: 1,
        cell,
        thin: 2.0 * cell,
    };
    let union = Union::new(soup.iter().map(single).collect());
    compare(&union, &TriangleSource::Indexed(mesh.vertices, mesh.triangles), &asked).expect("a mesh")
}

/// The same in cells.
pub fn in_cells(mut told: MeshComparison, cell: f64) -> MeshComparison {
    for distances in [&mut told.mesh, &mut told.boundary].into_iter().chain(&mut told.creases) {
        let DistanceStatistics { mean, rms, p999, max, clear_p999, clear_max, .. } = distances;
        [mean, rms, p999, max, clear_p999, clear_max].into_iter().for_each(|value| *value /= cell);
    }
    told
}

#[test]
fn surfaces_are_where_the_boundary_is() {
    let all = ["overlap_boxes", "duplicate_box", "touching_layers", "spot40_model", "featuretype50_model"];
    for name in all.into_iter().step_by(part_or_all(2, 1)) {
        let soup = file(&format!("{name}.stl"));
        for &tolerance in part_or_all(&[0.0, 0.3][..], &[0.0, 0.1, 0.3]) {
            let told = off(name, &soup, 3, tolerance);
            let most = told.mesh.p999.max(told.boundary.p999);
            assert!(most <= tolerance + 0.1, "{name}: {told:?}");
        }
    }
}

#[test]
fn a_part_of_sharp_pieces_keeps_its_edges() {
    let soup: Soup = Mesh::merged(&sharp_part(1)).facets().collect();
    // Without self-intersections, too.
    meshed(&soup, at_depth(2), false);
    let told = off("sharp part", &soup, 3, 0.0);
    let creases = told.creases.expect("they were asked for");
    // A cell's own edges do not see every crease that passes it.
    assert!(creases.mean <= 0.03 && creases.count > 5000, "{creases:?}");
}

/// Creases followed through cells without a vertex of their own: sharp edges nearer, with a tolerance too, and beads still
/// without triangles that meet.
#[test]
fn followed_creases_keep_sharp_edges_closer() {
    let soup: Soup = Mesh::merged(&sharp_part(1)).facets().collect();
    let cell = root_of(&soup).spacing(3);
    let following = |cells: f64, cell: f64| ContourOptions {
        follow_creases: true,
        tolerance: cells * cell,
        ..Default::default()
    };
    let [all, merged] = [(0.0, 0.01), (0.1, 0.012)].map(|(cells, most)| {
        let (kept, _) = contoured(&soup, at_depth(3), &following(cells, cell));
        let triangles = kept.triangles.len();
        // Few points are far off and make up much of the mean, which fewer samples tell to a tenth only.
        let creases =
            in_cells(compared(&soup, kept, cell, 50_000), cell).creases.expect("they were asked for");
        println!("{triangles} triangles, tolerance {cells} cells, creases: {creases:?}");
        assert!(creases.mean <= most && creases.count > 25_000, "{creases:?}");
        triangles
    });
    assert!(7 * merged < all, "{merged} of {all}");
    for name in ["clover_beads.stl", "overlap_boxes.stl"] {
        let soup = file(name);
        let cell = root_of(&soup).spacing(2);
        for cells in [0.0, 0.1] {
            contoured(&soup, at_depth(2), &following(cells, cell));
        }
    }
}

/// Walls in three directions, turned so that none is parallel to an axis, with so many rooms between them along each, and
/// the volume of their union. Every room is a cavity.
pub fn walls(rooms: u32) -> (Soup, f64) {
    let (wall, room) = (0.45, 0.55);
    let edge = f64::from(rooms) * (wall + room) + wall;
    let mut walls = Vec::new();
    for axis in 0..3 {
        for n in 0..=rooms {
            let (mut low, mut high) = ([0.0; 3], [edge; 3]);
            low[axis] = f64::from(n) * (wall + room);
            high[axis] = low[axis] + wall;
            walls.push(cuboid(low, high).rotated([1.0, 2.0, 3.0], 0.5));
        }
    }
    let volume = edge.powi(3) - (f64::from(rooms) * room).powi(3);
    (Mesh::merged(&walls).facets().collect(), volume)
}

#[test]
fn thousands_of_cavities_are_found() {
    let (soup, volume) = walls(13);
    // 6 and 12 cells from room to room.
    for (depth, most) in [(2, 3e-3), (3, 1e-3)].into_iter().take(part_or_all(1, 2)) {
        let (_, report) = meshed(&soup, at_depth(depth), false);
        let error = report.signed_volume / volume - 1.0;
        println!("{} shells, volume off by {error:.1e} at depth {depth}", report.components);
        assert_eq!(report.components, 1 + 13 * 13 * 13);
        assert!(error.abs() < most, "{error}");
    }
}

/// A tube whose turns overlap. Its volume is that of libigl's exact self-union:
/// `make-input spiral -o spiral.stl; python bench-data/peers/exact_union.py spiral.stl --libigl`.
#[test]
fn a_spiral_that_overlaps_itself_has_its_volume() {
    let soup: Soup = spiral_tube(10, 64, 10.0, 1.2, 2.0).facets().collect();
    let (_, report) = meshed(&soup, at_depth(3), false);
    let error = report.signed_volume / SPIRAL_VOLUME - 1.0;
    println!("{error:.1e}");
    assert!(error.abs() < 1e-3 && report.components == 1, "{report}");
}

/// mm³.
const SPIRAL_VOLUME: f64 = 1443.7412467243655;
