//! `voids --mesh` and `--labels`: closed meshes of voids, also where two touch, behind throats and far from the origin.

use super::mesh_places::read_ply;
use super::voids::{cavity_behind_a_throat, hollow_block, json};
use crate::support::*;
use std::collections::BTreeMap;
use std::path::Path;

/// A mesh of some voids as the file has it.
struct VoidMesh {
    vertices: Vec<[f64; 3]>,
    /// Corners and void of each face.
    faces: Vec<([usize; 3], i32)>,
}

impl VoidMesh {
    /// Reads a binary PLY with three coordinates a vertex, and three corners and a number a face.
    fn read(path: &Path) -> VoidMesh {
        let (_, vertices, corners, numbers) = read_ply(path);
        let void = |numbers: Vec<i32>| {
            assert_eq!(numbers.len(), 1);
            numbers[0]
        };
        VoidMesh { vertices, faces: corners.into_iter().zip(numbers.into_iter().map(void)).collect() }
    }

    /// The volume of each void, by its number; its mesh must be closed and turned alike all over.
    fn volumes(&self) -> BTreeMap<i32, f64> {
        let mut edges: BTreeMap<(i32, usize, usize), i32> = BTreeMap::new();
        let mut volumes = BTreeMap::new();
        for ([a, b, c], void) in &self.faces {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *edges.entry((*void, *from.min(to), *from.max(to))).or_default() +=
                    if from < to { 1 } else { -1 };
            }
            // From a near place, so that nothing cancels.
            let [a, b, c] = [a, b, c].map(|n| [0, 1, 2].map(|k| self.vertices[*n][k] - self.vertices[0][k]));
            let cross = [0, 1, 2].map(|k| b[(k + 1) % 3] * c[(k + 2) % 3] - b[(k + 2) % 3] * c[(k + 1) % 3]);
            *volumes.entry(*void).or_default() += (0..3).map(|k| a[k] * cross[k]).sum::<f64>() / 6.0;
        }
        let open = edges.values().filter(|sum| **sum != 0).count();
        assert_eq!(open, 0, "open edges");
        volumes
    }

    /// An OBJ in which the voids lie in a row.
    fn apart(&self) -> String {
        let mut void_of = vec![0; self.vertices.len()];
        self.faces.iter().for_each(|(corners, void)| corners.iter().for_each(|n| void_of[*n] = *void));
        let vertex =
            |([x, y, z], void): (&[f64; 3], &i32)| format!("v {} {y} {z}\n", x + 64.0 * f64::from(*void));
        let vertices: String = self.vertices.iter().zip(&void_of).map(vertex).collect();
        let face = |([a, b, c], _): &([usize; 3], i32)| format!("f {} {} {}\n", a + 1, b + 1, c + 1);
        let faces: String = self.faces.iter().map(face).collect();
        vertices + &faces
    }

    /// Volumes must be those of the table, to its errors or this share.
    fn require_like(&self, table: &Path, share: f64) {
        let table = json(table);
        let rows = table["voids"].as_array().unwrap();
        let volumes = self.volumes();
        assert_eq!(volumes.len(), rows.len());
        for (void, volume) in volumes {
            let row = &rows[void as usize - 1];
            let number = |name: &str| row[name].as_f64().unwrap();
            let most = number("volume_error").max(share * number("volume"));
            assert!((volume - number("volume")).abs() <= most, "{volume} {row}");
        }
    }
}

#[test]
fn voids_that_touch_across_edges_of_cells_are_closed_each() {
    let dir = Scratch::new();
    let (part, out, mesh) = (dir.path("a.brf"), dir.path("v.json"), dir.path("v.ply"));
    // Cells as coarse as the beads are wide: nearly all voids touch others across an edge.
    run(&[&"build", &example("clover.gcode"), &"-o", &part, &"--depth", &"2", &"-q"]).ok_but_for("layer 1");
    run(&[&"voids", &part, &"-o", &out, &"--mesh", &mesh, &"-q"]).ok();
    let found = VoidMesh::read(&mesh);
    assert_eq!(found.volumes().len() as u64, json(&out)["count"].as_u64().unwrap());
    // Each by itself is free of self-intersections; two may cross in a cell that both have a part of.
    let apart = dir.file("apart.obj", found.apart());
    run(&[&"mesh", &apart, &"--check", &"-q"]).ok();
    let bytes = std::fs::read(&mesh).unwrap();
    for threads in ["1", "3"] {
        run(&[&"voids", &part, &"-o", &out, &"--mesh", &mesh, &"-q", &"--threads", &threads]).ok();
        assert!(std::fs::read(&mesh).unwrap() == bytes, "{threads} threads");
    }
}

#[test]
fn what_opens_through_a_throat_has_a_lid_there() {
    let dir = Scratch::new();
    let (part, out, mesh) = (cavity_behind_a_throat(&dir), dir.path("v.json"), dir.path("v.ply"));
    run(&[&"voids", &part, &"-o", &out, &"--closing", &"2", &"--mesh", &mesh, &"-q"]).ok();
    let found = VoidMesh::read(&mesh);
    found.require_like(&out, 0.0);
    // The cavity, and of the channel at most all that lies in the block.
    let (volume, cavity) = (found.volumes()[&1], 216.0);
    assert!(volume > cavity - 0.1 && volume < cavity + 1.2 * 1.2 * 6.9, "{volume}");
    run(&[&"mesh", &mesh, &"--check", &"-q"]).ok();
}

#[test]
fn meshes_of_voids_far_from_the_origin_keep_their_shape() {
    let dir = Scratch::new();
    let path = dir.file("far.obj", hollow_block([4_500_000.0, 5_350_000.0, 512.0]));
    let (part, out, mesh) = (dir.path("a.brf"), dir.path("v.json"), dir.path("v.ply"));
    run(&[&"build", &path, &"-o", &part, &"--cell", &"0.05", &"-q"]).ok();
    run(&[&"voids", &part, &"-o", &out, &"--mesh", &mesh, &"-q"]).ok();
    let found = VoidMesh::read(&mesh);
    found.require_like(&out, 0.0);
    let volume = found.volumes()[&1];
    assert!((volume / (1.4 * 0.6) - 1.0).abs() < 1e-3, "{volume}");
    let refused = run(&[&"voids", &part, &"-o", &out, &"--mesh", &dir.path("v.3mf"), &"-q"]).failed();
    assert!(
        refused.contains("write .ply, .obj or .vtp, which have 64") && !refused.contains("origin"),
        "{refused}"
    );
}

#[test]
fn labels_are_the_same_in_all_formats() {
    let dir = Scratch::new();
    let (part, out) = (cavity_behind_a_throat(&dir), dir.path("v.json"));
    let labels = |name: &str| {
        let path = dir.path(name);
        run(&[&"voids", &part, &"-o", &out, &"--closing", &"2", &"--labels", &path, &"-q"]).ok();
        std::fs::read(&path).unwrap()
    };
    let (array, raw) = (labels("l.npy"), labels("l.raw"));
    let words = array[array.len() - 2 * raw.len()..].as_chunks::<4>().0;
    let shorts = raw.as_chunks::<2>().0;
    let alike = |(word, short): (&[u8; 4], &[u8; 2])| {
        u32::from_le_bytes(*word) == u32::from(u16::from_le_bytes(*short))
    };
    assert!(words.iter().zip(shorts).all(alike));
    assert!(shorts.iter().any(|short| u16::from_le_bytes(*short) == 1));
    let grid = labels("l.vdb");
    assert!(grid.windows(16).any(|window| window == b"Tree_int32_5_4_3"));
    let what = run(&[&"voids", &part, &"-o", &out, &"--labels", &dir.path("l.csv")]).misused();
    assert!(what.contains("one of .npy, .vdb"), "{what}");
}
