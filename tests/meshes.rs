//! Meshes of real trees, judged by a half-edge check that shares no code with the engine: every closed input and
//! random piles at three depths, volumes against the truth, sharp edges and corners of rotated boxes.

use brickfield_bench_data::judge::mesh::{Report, check};
use brickfield_bench_data::pile::{lattice_pile, random_pile};
use brickfield_bench_data::shapes::cuboid;
use brickfield_bench_data::{Mesh, Rng};
use brickfield_engine::build::{TreeOptions, build_in_memory, build_open_in_memory};
use brickfield_engine::contour::{ContourOptions, Facet, MeshSink, contour};
use brickfield_engine::ingest::Input;
use brickfield_engine::lattice::RootCube;
use brickfield_engine::store::Refine;
use brickfield_engine::{Result, Silent};
use proptest::prelude::*;
use std::path::Path;

/// Keeps the mesh.
#[derive(Default)]
struct Kept {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl MeshSink for Kept {
    fn vertices(&mut self, positions: &[[f32; 3]]) -> Result<()> {
        self.vertices.extend(positions.iter().map(|p| p.map(f64::from)));
        Ok(())
    }

    fn triangles(&mut self, facets: &[Facet]) -> Result<()> {
        self.triangles.extend(facets.iter().map(|f| f.ids));
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}

type Soup = Vec<[[f64; 3]; 3]>;

fn root_of(soup: &Soup) -> RootCube {
    let all = || soup.iter().flatten();
    let min = std::array::from_fn(|a| all().fold(f64::MAX, |m, v| m.min(v[a])));
    let max = std::array::from_fn(|a| all().fold(f64::MIN, |m, v| m.max(v[a])));
    RootCube::around(min, max).expect("an extent")
}

/// The mesh of a soup's tree, and what the judge says of it. Vertices are also welded by position, as a reader
/// of an STL file would, where `weld` asks for it.
fn meshed(soup: &Soup, options: TreeOptions, weld: bool) -> (Kept, Report) {
    let tree = build_in_memory(&[soup], root_of(soup), options).unwrap_or_else(|e| panic!("{e}"));
    let mut kept = Kept::default();
    contour(&tree, &ContourOptions::default(), &mut kept, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let report = check(&kept.vertices, &kept.triangles);
    assert!(report.is_closed_manifold() && report.is_oriented(), "{report}");
    if weld {
        let facets: Vec<[[f32; 3]; 3]> =
            kept.triangles.iter().map(|t| t.map(|v| kept.vertices[v as usize].map(|c| c as f32))).collect();
        let welded = brickfield_bench_data::judge::mesh::check_soup(&facets);
        assert!(welded.is_closed_manifold(), "{welded}");
    }
    (kept, report)
}

fn at_depth(depth: u8) -> TreeOptions {
    TreeOptions { depth, ..Default::default() }
}

fn file(name: &str) -> Soup {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../bench-data/stl").join(name);
    let input = Input::open(&path, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let mut soup = Vec::new();
    input.read(0..input.facets(), &mut soup);
    soup
}

#[test]
fn every_closed_file_gives_a_closed_manifold_at_three_depths() {
    for name in [
        "ascii_two_solids",
        "box_with_cavity",
        "clover_beads",
        "clover_model",
        "duplicate_box",
        "featuretype50_model",
        "inverted_box",
        "overlap_boxes",
        "spot40_model",
        "thinwall_ladder",
        "touching_layers",
        "void_ladder",
    ] {
        let soup = file(&format!("{name}.stl"));
        for depth in [1, 2, 3] {
            let (kept, _) = meshed(&soup, at_depth(depth), true);
            assert_eq!(kept.triangles.is_empty(), name == "inverted_box", "{name}");
        }
    }
}

#[test]
fn volumes_are_true_at_every_depth() {
    let truth = [
        ("overlap_boxes", 1600.0),
        ("box_with_cavity", 936.0),
        ("duplicate_box", 1000.0),
        ("touching_layers", 400.0),
        ("ascii_two_solids", 1008.0),
        ("thinwall_ladder", 4080.0),
        ("void_ladder", 23568.437084962865),
    ];
    for (name, volume) in truth {
        let soup = file(&format!("{name}.stl"));
        let errors = [1, 2, 3, 4]
            .map(|depth| (meshed(&soup, at_depth(depth), false).1.signed_volume / volume - 1.0).abs());
        println!("{name}: {errors:?}");
        // 64 to 512 cells across. A face that lies on a cell border moves by 1/256 of a cell, the margin that
        // keeps vertices inside their cells, so the smallest errors need not shrink further.
        assert!(errors[1] < 0.01 && errors[2] < 0.001 && errors[3] < 0.0002, "{name}: {errors:?}");
    }
}

#[test]
fn leaves_of_many_levels_give_closed_manifolds() {
    // Thresholds that keep coarse leaves with a boundary beside fine ones.
    let mut mixed = 0;
    for (number, stddev) in [0.05, 0.1, 0.2, 0.3].into_iter().enumerate() {
        let pile = Mesh::merged(&random_pile(40 + number as u64, 8));
        let soup: Soup = pile.facets().collect();
        for refine in [Refine::Hidden, Refine::Stddev, Refine::Surface] {
            let options = TreeOptions { depth: 3, refine, stddev };
            let tree = build_in_memory(&[&soup], root_of(&soup), options).unwrap();
            let mut kept = Kept::default();
            mixed += contour(&tree, &ContourOptions::default(), &mut kept, &Silent).unwrap().mixed_cells;
            let report = check(&kept.vertices, &kept.triangles);
            assert!(report.is_closed_manifold(), "{refine:?} {stddev}: {report}");
        }
    }
    assert!(mixed > 1000, "{mixed}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, failure_persistence: None, ..Default::default() })]

    #[test]
    fn random_piles_give_closed_manifolds(seed in any::<u64>(), pieces in 1usize..12) {
        let soup: Soup = Mesh::merged(&random_pile(seed, pieces)).facets().collect();
        for depth in [0, 1, 3] {
            meshed(&soup, at_depth(depth), false);
        }
    }

    #[test]
    fn lattice_piles_give_closed_manifolds(seed in any::<u64>(), pieces in 1usize..12) {
        let soup: Soup = Mesh::merged(&lattice_pile(seed, pieces, 2, 40)).facets().collect();
        for depth in [0, 1, 2] {
            meshed(&soup, at_depth(depth), false);
        }
    }
}

/// A rotated box: its half extents, its rotation, and the soup.
struct Rotated {
    half: [f64; 3],
    turn: [f64; 4],
    soup: Soup,
}

impl Rotated {
    fn new(seed: u64) -> Rotated {
        let mut rng = Rng::new(seed);
        let half: [f64; 3] = std::array::from_fn(|_| rng.range(3.0, 10.0));
        let turn = rng.quaternion();
        let mesh = cuboid(half.map(|h| -h), half).rotated_by(turn);
        Rotated { half, turn, soup: mesh.facets().collect() }
    }

    /// A point in the box's own frame, by the inverse rotation.
    fn own(&self, p: [f64; 3]) -> [f64; 3] {
        let [w, x, y, z] = self.turn;
        rotate([w, -x, -y, -z], p)
    }
}

fn rotate([w, x, y, z]: [f64; 4], p: [f64; 3]) -> [f64; 3] {
    let point = Mesh { vertices: vec![p], triangles: Vec::new() };
    point.rotated_by([w, x, y, z]).vertices[0]
}

/// Distance of a point from the nearest of the box's creases, the line segments where two faces meet.
fn to_crease(half: [f64; 3], p: [f64; 3]) -> f64 {
    (0..3)
        .map(|along| {
            let off = |a: usize| {
                if a == along { (p[a].abs() - half[a]).max(0.0) } else { p[a].abs() - half[a] }
            };
            (0..3).map(|a| off(a).powi(2)).sum::<f64>().sqrt()
        })
        .fold(f64::MAX, f64::min)
}

#[test]
fn rotated_boxes_keep_their_edges_and_corners() {
    let (mut creased, mut off_crease) = (0, 0);
    let mut corners = Vec::new();
    for seed in 0..12 {
        let rotated = Rotated::new(seed);
        let root = root_of(&rotated.soup);
        let cell = root.spacing(2);
        let (kept, _) = meshed(&rotated.soup, at_depth(2), false);
        for &p in &kept.vertices {
            // The crease passes through the middle of the vertex's cell, so the cell's edges see both faces.
            let units = root.to_units(p);
            let spacing = f64::from(1 << 17);
            let middle = units.map(|u| (((u - 1.0) / spacing).floor() + 0.5) * spacing + 1.0);
            if to_crease(rotated.half, rotated.own(root.to_world(middle))) < 0.2 * cell {
                creased += 1;
                let distance = to_crease(rotated.half, rotated.own(p)) / cell;
                off_crease += usize::from(distance > 0.05);
            }
        }
        for corner in 0..8 {
            let own: [f64; 3] =
                std::array::from_fn(
                    |a| if corner >> a & 1 == 1 { rotated.half[a] } else { -rotated.half[a] },
                );
            let at = rotate(rotated.turn, own);
            let distance = |p: &[f64; 3]| (0..3).map(|a| (p[a] - at[a]).powi(2)).sum::<f64>().sqrt();
            corners.push(kept.vertices.iter().map(distance).fold(f64::MAX, f64::min) / cell);
        }
    }
    corners.sort_by(f64::total_cmp);
    let (median, sharp) = (corners[corners.len() / 2], corners.iter().filter(|d| **d < 0.05).count());
    println!(
        "{creased} vertices in creased cells, {off_crease} farther than 0.05 cells from the crease; corners: \
         median {median:.4}, {sharp} of {} within 0.05 cells, worst {:.3}",
        corners.len(),
        corners[corners.len() - 1]
    );
    assert!(creased > 1000 && off_crease == 0, "{off_crease} of {creased}");
    // 94 corners are met. The two others are tips within 0.12 cells of a brick's border, beyond which corners
    // are not looked for; they stay cut off by 0.127 cells.
    assert!(median < 0.001 && sharp >= 94 && corners[corners.len() - 1] < 0.15, "{corners:?}");
}

fn meshed_open(soup: &Soup, depth: u8) -> Report {
    let tree =
        build_open_in_memory(&[soup], root_of(soup), at_depth(depth), 1e-3).unwrap_or_else(|e| panic!("{e}"));
    let mut kept = Kept::default();
    contour(&tree, &ContourOptions::default(), &mut kept, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let report = check(&kept.vertices, &kept.triangles);
    assert!(report.is_closed_manifold() && report.is_oriented() && !kept.triangles.is_empty(), "{report}");
    report
}

#[test]
fn open_soups_give_closed_manifolds() {
    let cube = file("overlap_boxes.stl");
    let whole = 1600.0;
    let mut lidless = cube.clone();
    lidless.remove(3);
    // What the missing half of a face lets out is made up for by a bulge of some size.
    let volume = meshed_open(&lidless, 2).signed_volume;
    assert!((volume / whole - 1.0).abs() < 0.1, "{volume}");
    let holed: Soup = file("spot40_model.stl")
        .into_iter()
        .enumerate()
        .filter(|(i, _)| i % 50 != 3)
        .map(|(_, t)| t)
        .collect();
    meshed_open(&holed, 1);
    let flipped: Soup =
        cube.iter().enumerate().map(|(i, t)| if i == 5 { [t[1], t[0], t[2]] } else { *t }).collect();
    meshed_open(&flipped, 2);
}

/// Sheets above each other: behind them w is about 2, beyond the root too, where the surface is cut off.
#[test]
fn a_surface_that_leaves_the_root_is_closed_at_its_faces() {
    let sheet = |z: f64| {
        [[[0.0, 0.0, z], [10.0, 0.0, z], [10.0, 10.0, z]], [[0.0, 0.0, z], [10.0, 10.0, z], [0.0, 10.0, z]]]
    };
    let soup: Soup = (0..5).flat_map(|i| sheet(9.0 + f64::from(i) * 0.25)).collect();
    assert!(meshed_open(&soup, 2).signed_volume > 100.0);
}
