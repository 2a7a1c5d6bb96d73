//! A union of convex pieces, less those that are inside out, as a function that fidget meshes by manifold dual contouring.
//!
//!     fidget-contour PIECES.stl DEPTH [MESH.ply]
//!
//! Every piece, facets that hang together by vertices, is the maximum over the planes of its facets. The root cube is 32/31
//! of the longest side, as Brickfield's. Prints one line of JSON: seconds and processor time of the octree and the mesh.

use fidget::context::Tree;
use fidget::jit::JitShape;
use fidget::mesh::{Mesh, Octree, Settings};
use std::collections::HashMap;
use std::error::Error;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::time::Instant;

type V3 = [f64; 3];
/// Planes whose unit normals and offsets differ by less are one: facets are rounded to 32 bits.
const SAME_PLANE: f64 = 1e-4;
/// As `RootCube::around` of the engine.
const ROOT_MARGIN: f64 = 32.0 / 31.0;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().collect();
    let [_, soup, depth, mesh @ ..] = words.as_slice() else {
        return Err("usage: fidget-contour PIECES.stl DEPTH [MESH.ply]".into());
    };
    let facets = read_stl(soup)?;
    let corners = || facets.iter().flatten();
    let least: V3 = std::array::from_fn(|a| corners().map(|p| p[a]).fold(f64::INFINITY, f64::min));
    let most: V3 = std::array::from_fn(|a| corners().map(|p| p[a]).fold(f64::NEG_INFINITY, f64::max));
    let half = 0.5 * ROOT_MARGIN * (0..3).map(|a| most[a] - least[a]).fold(0.0, f64::max);
    let middle: V3 = std::array::from_fn(|a| 0.5 * (least[a] + most[a]));
    let pieces = pieces(&facets);
    let solids = |outward: bool| -> Result<Option<Tree>, Box<dyn Error>> {
        let chosen: Vec<_> = pieces.iter().filter(|piece| (volume(piece) > 0.0) == outward).collect();
        let solids: Result<Vec<Tree>, _> =
            chosen.into_iter().map(|piece| solid(piece, middle, half)).collect();
        Ok(joined(solids?, &|a, b| a.min(b)))
    };
    let added = solids(true)?.ok_or("no piece points outward")?;
    let tree = solids(false)?.map_or(added.clone(), |taken| added.max(-taken));
    let shape = JitShape::from(tree);
    let bound = shape.try_into().map_err(|_| "a function of more than a place")?;
    let settings = Settings { depth: depth.parse()?, ..Settings::default() };

    let (begun, processor) = (Instant::now(), processor_seconds());
    let octree = Octree::build(&bound, &settings).ok_or("cancelled")?;
    let made = octree.walk_dual();
    let (seconds, spent) = (begun.elapsed().as_secs_f64(), processor_seconds() - processor);
    if let [path, ..] = mesh {
        write_ply(path, &made, middle, half)?;
    }
    println!(
        "{{\"version\": \"{VERSION}\", \"pieces\": {}, \"seconds\": {seconds:.4}, \"cpu_seconds\": {spent:.2}, \
         \"vertices\": {}, \"triangles\": {}}}",
        pieces.len(),
        made.vertices.len(),
        made.triangles.len()
    );
    Ok(())
}

/// Of fidget, as Cargo.toml pins it.
const VERSION: &str = "0.5.1";

/// Facets of a binary STL.
fn read_stl(path: &str) -> Result<Vec<[V3; 3]>, Box<dyn Error>> {
    let bytes = fs::read(path)?;
    let records = bytes.get(84..).ok_or("not a binary STL")?.chunks_exact(50);
    let corner = |at: &[u8]| {
        std::array::from_fn(|a| {
            f64::from(f32::from_le_bytes([at[4 * a], at[4 * a + 1], at[4 * a + 2], at[4 * a + 3]]))
        })
    };
    Ok(records.map(|record| std::array::from_fn(|v| corner(&record[12 + 12 * v..]))).collect())
}

/// The facets of each piece.
fn pieces(facets: &[[V3; 3]]) -> Vec<Vec<[V3; 3]>> {
    let mut numbers = HashMap::new();
    let mut number = |p: V3| {
        let next = numbers.len();
        *numbers.entry(p.map(f64::to_bits)).or_insert(next)
    };
    let own: Vec<[usize; 3]> = facets.iter().map(|facet| facet.map(&mut number)).collect();
    let mut parents: Vec<usize> = (0..numbers.len()).collect();
    fn root(parents: &mut [usize], mut n: usize) -> usize {
        while parents[n] != n {
            parents[n] = parents[parents[n]];
            n = parents[n];
        }
        n
    }
    for &[a, b, c] in &own {
        for other in [b, c] {
            let (from, to) = (root(&mut parents, a), root(&mut parents, other));
            parents[from] = to;
        }
    }
    let (mut pieces, mut known) = (Vec::new(), HashMap::new());
    for (facet, &[a, ..]) in facets.iter().zip(&own) {
        let piece = *known.entry(root(&mut parents, a)).or_insert_with(|| {
            pieces.push(Vec::new());
            pieces.len() - 1
        });
        pieces[piece].push(*facet);
    }
    pieces
}

fn volume(piece: &[[V3; 3]]) -> f64 {
    piece.iter().map(|&[a, b, c]| dot(a, cross(b, c))).sum::<f64>() / 6.0
}

/// A convex piece in the cube of −1 to 1, negative inside, whichever way its facets point.
fn solid(piece: &[[V3; 3]], middle: V3, half: f64) -> Result<Tree, Box<dyn Error>> {
    let sign = volume(piece).signum();
    let within = |p: V3| -> V3 { std::array::from_fn(|a| (p[a] - middle[a]) / half) };
    let mut planes: Vec<(V3, f64)> = Vec::new();
    for facet in piece {
        let [a, b, c] = facet.map(within);
        let n = cross(sub(b, a), sub(c, a));
        let n = n.map(|x| sign * x / dot(n, n).sqrt());
        let offset = dot(n, a);
        let same =
            |&(m, other): &(V3, f64)| dot(m, n) > 1.0 - SAME_PLANE && (other - offset).abs() < SAME_PLANE;
        if !planes.iter().any(same) {
            planes.push((n, offset));
        }
    }
    let outside = |&(n, offset): &(V3, f64)| {
        piece.iter().flatten().map(|&p| dot(n, within(p)) - offset).fold(0.0, f64::max)
    };
    if planes.iter().map(outside).fold(0.0, f64::max) > SAME_PLANE {
        return Err("a piece is not convex".into());
    }
    let (x, y, z) = Tree::axes();
    let plane = |(n, offset): (V3, f64)| {
        let [a, b, c] = n.map(|x| Tree::constant(x as f32));
        x.clone() * a + y.clone() * b + z.clone() * c - Tree::constant(offset as f32)
    };
    joined(planes.into_iter().map(plane).collect(), &|a, b| a.max(b)).ok_or("a piece without facets".into())
}

/// All together, as a balanced tree.
fn joined(mut trees: Vec<Tree>, join: &dyn Fn(Tree, Tree) -> Tree) -> Option<Tree> {
    while trees.len() > 1 {
        let mut pairs = Vec::new();
        let mut left = trees.into_iter();
        while let Some(a) = left.next() {
            pairs.push(match left.next() {
                Some(b) => join(a, b),
                None => a,
            });
        }
        trees = pairs;
    }
    trees.pop()
}

fn write_ply(path: &str, mesh: &Mesh, middle: V3, half: f64) -> Result<(), Box<dyn Error>> {
    let mut file = BufWriter::new(File::create(path)?);
    write!(
        file,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertices.len(),
        mesh.triangles.len()
    )?;
    for vertex in &mesh.vertices {
        for axis in 0..3 {
            file.write_all(&((middle[axis] + half * f64::from(vertex[axis])) as f32).to_le_bytes())?;
        }
    }
    for triangle in &mesh.triangles {
        file.write_all(&[3])?;
        for &corner in triangle.iter() {
            file.write_all(&u32::try_from(corner)?.to_le_bytes())?;
        }
    }
    Ok(file.flush()?)
}

/// User and system time of this process, to 10 ms.
fn processor_seconds() -> f64 {
    let text = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = text.rsplit_once(") ").map_or("", |(_, fields)| fields);
    let ticks = fields.split(' ').skip(11).take(2).filter_map(|field| field.parse::<f64>().ok());
    ticks.sum::<f64>() / 100.0
}

fn dot(a: V3, b: V3) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn sub(a: V3, b: V3) -> V3 {
    std::array::from_fn(|i| a[i] - b[i])
}

fn cross(a: V3, b: V3) -> V3 {
    std::array::from_fn(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}
