//! Pieces with a table or a formula of their own.

use crate::Mesh;
use crate::trig::sin_cos;
use crate::vector::{add, scale, unit};
use std::collections::HashMap;
use std::f64::consts::TAU;

/// The corners of a box by number (bit 0: upper x, bit 1: upper y, bit 2: upper z), two facets a side.
const CUBE: [[u32; 4]; 6] =
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// The box between two corners: 8 vertices, 12 triangles.
///
/// # Panics
/// If `max` does not exceed `min` on every axis.
pub fn cuboid(min: [f64; 3], max: [f64; 3]) -> Mesh {
    assert!((0..3).all(|a| min[a] < max[a]), "an empty box has no outside: {min:?} to {max:?}");
    let corner = |i: usize| std::array::from_fn(|a| if i >> a & 1 == 1 { max[a] } else { min[a] });
    let triangles = CUBE.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Mesh { vertices: (0..8).map(corner).collect(), triangles }
}

/// The cube −`half`..`half` with a pyramid of the given `height` on each side: 14 vertices, 24 triangles.
///
/// `height` = `half` is the rhombic dodecahedron, all of whose faces lie at 45° to two axes; more makes a
/// star, less than 0 (but above −`half`) dents the cube.
pub fn spiked_cube(half: f64, height: f64) -> Mesh {
    assert!(half > 0.0 && height > -half && height != 0.0, "no such solid: {half}, {height}");
    let mut mesh = Mesh { triangles: Vec::with_capacity(24), ..cuboid([-half; 3], [half; 3]) };
    for (side, corners) in CUBE.iter().enumerate() {
        let mut apex = [0.0; 3];
        apex[side / 2] = if side % 2 == 0 { -half - height } else { half + height };
        mesh.vertices.push(apex);
        mesh.triangles.extend((0..4).map(|i| [corners[i], corners[(i + 1) % 4], 8 + side as u32]));
    }
    mesh
}

/// The bipyramid |x| + |y| + |z| = `radius`: 6 vertices, 8 triangles.
pub fn octahedron(radius: f64) -> Mesh {
    let mut vertices = Vec::with_capacity(6);
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let mut v = [0.0; 3];
            v[axis] = sign * radius;
            vertices.push(v);
        }
    }
    let facet = |i: u32| {
        let [x, y, z] = [i & 1, 2 + (i >> 1 & 1), 4 + (i >> 2)];
        // An odd number of mirrored axes turns the facet over.
        if i.count_ones() % 2 == 1 { [x, y, z] } else { [x, z, y] }
    };
    Mesh { vertices, triangles: (0..8).map(facet).collect() }
}

/// The tetrahedron over four points, oriented outward whatever their order.
///
/// # Panics
/// If the points lie in one plane.
pub fn tetrahedron(corners: [[f64; 3]; 4]) -> Mesh {
    let mesh =
        Mesh { vertices: corners.to_vec(), triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]] };
    let volume = mesh.signed_volume();
    assert!(volume != 0.0, "a flat tetrahedron has no outside: {corners:?}");
    if volume < 0.0 { mesh.flipped() } else { mesh }
}

/// The box `0..size` sheared so that its x sides rise at 45° in z: faces exactly on both 45° diagonals of
/// the xz plane if the sizes are integers.
pub fn slant(size: [f64; 3]) -> Mesh {
    cuboid([0.0; 3], size).mapped(|v| [v[0] + v[2], v[1], v[2]])
}

/// The icosahedron with each triangle divided in four `subdivisions` times, vertices on the sphere of
/// `radius` about the origin: 20·4^subdivisions triangles.
pub fn icosphere(subdivisions: u32, radius: f64) -> Mesh {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut vertices = Vec::new();
    for axis in 0..3 {
        for (one, long) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
            let mut v = [0.0; 3];
            (v[axis], v[(axis + 1) % 3]) = (one, long);
            vertices.push(unit(v));
        }
    }
    let mut triangles = hull_of_icosahedron(&vertices);
    for _ in 0..subdivisions {
        triangles = divided(&triangles, &mut vertices);
    }
    let vertices = vertices.into_iter().map(|v| scale(v, radius)).collect();
    Mesh { vertices, triangles }
}

/// The faces are the triples of mutually neighbouring vertices; no table to get wrong.
fn hull_of_icosahedron(vertices: &[[f64; 3]]) -> Vec<[u32; 3]> {
    let near = |a: u32, b: u32| {
        let [a, b] = [a, b].map(|i| vertices[i as usize]);
        crate::vector::dot(a, b) > 0.4
    };
    let mut faces = Vec::with_capacity(20);
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    let [p, q, r] = [a, b, c].map(|i| vertices[i as usize]);
                    let outward = crate::vector::dot(p, crate::vector::cross(q, r)) > 0.0;
                    faces.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    faces
}

fn divided(triangles: &[[u32; 3]], vertices: &mut Vec<[f64; 3]>) -> Vec<[u32; 3]> {
    let mut middles: HashMap<(u32, u32), u32> = HashMap::with_capacity(triangles.len() * 3 / 2);
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            vertices.push(unit(add(vertices[a as usize], vertices[b as usize])));
            vertices.len() as u32 - 1
        })
    };
    let mut finer = Vec::with_capacity(triangles.len() * 4);
    for &[a, b, c] in triangles {
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    finer
}

/// The torus about the z axis: `around`·`across`·2 triangles, both counts at least 3, `minor` < `major`.
pub fn torus(major: f64, minor: f64, around: u32, across: u32) -> Mesh {
    assert!(around >= 3 && across >= 3 && 0.0 < minor && minor < major);
    let mut mesh = Mesh::default();
    for i in 0..around {
        let (si, ci) = sin_cos(TAU * f64::from(i) / f64::from(around));
        for j in 0..across {
            let (sj, cj) = sin_cos(TAU * f64::from(j) / f64::from(across));
            let r = major + minor * cj;
            mesh.vertices.push([r * ci, r * si, minor * sj]);
            let (i1, j1) = ((i + 1) % around, (j + 1) % across);
            let [a, b, c, d] = [i * across + j, i1 * across + j, i1 * across + j1, i * across + j1];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}
