//! Many inputs at four depths with three tolerances and without.

use super::truth::walls;
use super::{Kept, Solid, Soup, at_depth, file, meetings, root_of};
use brickfield_bench_data::judge::mesh::{MeshFindings, check, check_soup};
use brickfield_bench_data::pile::{bead_pile, lattice_pile, random_pile, sharp_part};
use brickfield_bench_data::shapes::spiral_tube;
use brickfield_bench_data::{Mesh, Rng};
use brickfield_engine::Silent;
use brickfield_engine::build::{build_in_memory, build_open_in_memory};
use brickfield_engine::contour::{ContourOptions, contour};
use brickfield_engine::store::MemoryTree;

const DEPTHS: [u8; 4] = [1, 2, 3, 4];
/// In cells.
const TOLERANCES: [f64; 4] = [0.0, 0.01, 0.1, 0.3];

struct Part {
    name: String,
    soup: Soup,
    is_open: bool,
    /// It is made of flat faces, so its creases are followed, too.
    is_sharp: bool,
}

impl Part {
    fn closed(name: impl Into<String>, soup: Soup) -> Part {
        Part { name: name.into(), soup, is_open: false, is_sharp: false }
    }

    fn sharp(name: impl Into<String>, soup: Soup) -> Part {
        Part { is_sharp: true, ..Part::closed(name, soup) }
    }

    fn open(name: impl Into<String>, soup: Soup) -> Part {
        Part { is_open: true, ..Part::closed(name, soup) }
    }

    fn tree(&self, depth: u8) -> MemoryTree {
        let (root, options) = (root_of(&self.soup), at_depth(depth));
        let built = match self.is_open {
            true => build_open_in_memory(&[&self.soup], root, options, 1e-3),
            false => build_in_memory(&[&self.soup], root, options),
        };
        built.unwrap_or_else(|e| panic!("{}: {e}", self.name))
    }
}

fn parts() -> Vec<Part> {
    let merged = |meshes: &[Mesh]| -> Soup { Mesh::merged(meshes).facets().collect() };
    let closed = ["clover_beads", "clover_model", "featuretype50_model", "spot40_model", "void_ladder"];
    let mut parts: Vec<Part> =
        closed.map(|name| Part::closed(name, file(&format!("{name}.stl")))).into_iter().collect();
    let sharp = ["ascii_two_solids", "box_with_cavity", "duplicate_box", "overlap_boxes", "thinwall_ladder"];
    parts.extend(sharp.map(|name| Part::sharp(name, file(&format!("{name}.stl")))));
    parts.push(Part::sharp("touching_layers", file("touching_layers.stl")));
    parts.extend(
        (0..8).map(|n| Part::closed(format!("pile {n}"), merged(&random_pile(300 + n, 4 + n as usize)))),
    );
    parts.extend(
        (0..2).map(|n| Part::sharp(format!("lattice {n}"), merged(&lattice_pile(300 + n, 8, 2, 40)))),
    );
    let beads = bead_pile(1, 25_000, [50.0, 50.0, 6.0]);
    parts.push(Part::closed(
        "beads",
        (0..beads.beads()).flat_map(|n| beads.bead(n).facets().collect::<Soup>()).collect(),
    ));
    parts.extend((0..2).map(|n| Part::sharp(format!("turned box {n}"), Solid::cuboid(300 + n).soup)));
    parts.extend((0..2).map(|n| Part::sharp(format!("wedge {n}"), Solid::wedge(300 + n).soup)));
    parts.extend((0..2).map(|n| Part::sharp(format!("tetrahedron {n}"), Solid::tetrahedron(300 + n).soup)));
    for n in 0..3 {
        let two = [Solid::cuboid(310 + n).soup, Solid::cuboid(320 + n).soup].concat();
        parts.push(Part::sharp(format!("two boxes {n}"), two));
    }
    parts.push(Part::sharp("part with sharp edges", merged(&sharp_part(1))));
    parts.push(Part::closed("spiral", spiral_tube(10, 64, 10.0, 1.2, 2.0).facets().collect()));
    parts.push(Part::sharp("rooms", walls(5).0));
    // A share of the facets is missing, at random.
    for (name, missing) in [
        ("overlap_boxes", 0.1),
        ("spot40_model", 0.02),
        ("clover_model", 0.02),
        ("featuretype50_model", 0.01),
    ] {
        let mut rng = Rng::new(330);
        let mut soup = file(&format!("{name}.stl"));
        soup.retain(|_| rng.range(0.0, 1.0) >= missing);
        parts.push(Part::open(format!("{name} with holes"), soup));
    }
    parts.push(Part::open("open_box_no_lid", file("open_box_no_lid.stl")));
    parts
}

/// A mesh, and what is wrong with it.
fn judged(tree: &MemoryTree, options: &ContourOptions) -> (MeshFindings, Option<String>) {
    let mut kept = Kept::default();
    contour(tree, options, &mut kept, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let report = check(&kept.vertices, &kept.triangles);
    if kept.triangles.is_empty() {
        return (report, Some("is empty".to_owned()));
    }
    let wrong = if !report.is_closed_manifold() || !report.is_oriented() {
        Some(format!("is not closed, oriented and manifold: {report}"))
    } else if !check_soup(&kept.facets()).is_closed_manifold() {
        Some("is not closed and manifold when welded by place".to_owned())
    } else if meetings(&kept) != [0; 2] {
        Some(format!("has pairs that meet and triangles without area: {:?}", meetings(&kept)))
    } else {
        None
    };
    (report, wrong)
}

/// All are closed, oriented, edge- and vertex-manifold, by number and by place, no triangles meet, and a tolerance changes
/// neither shells nor handles.
#[test]
#[ignore = "twenty minutes"]
fn many_inputs_at_four_depths_with_three_tolerances() {
    let (mut meshes, mut triangles, mut failures) = (0, 0, Vec::new());
    let parts = parts();
    for part in &parts {
        let before = (meshes, triangles, failures.len());
        for depth in DEPTHS {
            let tree = part.tree(depth);
            let cell = root_of(&part.soup).spacing(depth);
            for follow_creases in [false, true].into_iter().take(1 + usize::from(part.is_sharp)) {
                let mut plain: Option<[i64; 2]> = None;
                for cells in TOLERANCES {
                    let options =
                        ContourOptions { tolerance: cells * cell, follow_creases, ..Default::default() };
                    let (report, wrong) = judged(&tree, &options);
                    (meshes, triangles) = (meshes + 1, triangles + report.triangles);
                    let topology = [report.components as i64, report.euler_characteristic];
                    let wrong = wrong.or_else(|| {
                        let plain = *plain.get_or_insert(topology);
                        (plain != topology).then(|| {
                            format!("has shells and Euler characteristic {topology:?}, not {plain:?}")
                        })
                    });
                    failures.extend(wrong.map(|what| {
                        format!(
                            "{} at depth {depth}, {cells} cells, creases {follow_creases}: {what}",
                            part.name
                        )
                    }));
                }
            }
        }
        println!(
            "{}: {} meshes, {} triangles, {} failures",
            part.name,
            meshes - before.0,
            triangles - before.1,
            failures.len() - before.2
        );
    }
    println!("{} inputs, {meshes} meshes, {triangles} triangles, {} failures", parts.len(), failures.len());
    assert!(failures.is_empty(), "{failures:#?}");
}
