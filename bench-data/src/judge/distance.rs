//! How far a mesh is from the boundary of a union, both ways.
//!
//! Points of the mesh look for the boundary in the tree of the soup. The mesh may be ten times as large, so it is not
//! held: points of the boundary wait in a grid while its triangles pass by, again for those that none came near.

use crate::Rng;
use crate::judge::boundary::{Union, anywhere, nearest_of};
use crate::judge::read::{self, FileMesh, ReadError};
use crate::judge::tree::normal;
use crate::vector::{V3, dot, norm, sub};
use rayon::prelude::*;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Triangles that are in memory at a time: 6.5 MB of a file.
const BLOCK: u64 = 1 << 17;

/// The triangles of a mesh, as often as they are asked for.
pub enum TriangleSource {
    /// A binary STL file and their number; it is read a block at a time.
    Stl(PathBuf, u64),
    /// Of a PLY or an OBJ file, or made here.
    Indexed(Vec<[f64; 3]>, Vec<[u32; 3]>),
}

impl TriangleSource {
    /// Those of a binary STL, binary PLY or OBJ file.
    ///
    /// # Errors
    /// If the file cannot be read as the kind its ending names, or has no triangle.
    pub fn open(path: &Path) -> Result<TriangleSource, ReadError> {
        let triangles = if path.extension().is_some_and(|ending| ending == "stl") {
            let mut head = [0; 84];
            let file = File::open(path)?;
            let bytes = file.metadata()?.len();
            (&file).take(84).read_exact(&mut head)?;
            let count = u64::from(u32::from_le_bytes([head[80], head[81], head[82], head[83]]));
            if bytes != 84 + 50 * count {
                let told = format!("{count} facets take {} bytes, the file has {bytes}", 84 + 50 * count);
                return Err(ReadError::Format(told));
            }
            TriangleSource::Stl(path.to_owned(), count)
        } else {
            match read::read(path)? {
                FileMesh::Indexed(vertices, triangles) => TriangleSource::Indexed(vertices, triangles),
                FileMesh::Soup(_) => unreachable!("an STL file"),
            }
        };
        if triangles.count() == 0 {
            Err(ReadError::Format("it has no triangle".into()))
        } else {
            Ok(triangles)
        }
    }

    /// How many there are.
    pub fn count(&self) -> u64 {
        match self {
            TriangleSource::Stl(_, count) => *count,
            TriangleSource::Indexed(_, triangles) => triangles.len() as u64,
        }
    }

    /// All triangles in order, a block at a time.
    fn blocks(&self, mut visit: impl FnMut(&[[V3; 3]])) -> Result<(), ReadError> {
        match self {
            TriangleSource::Stl(path, count) => {
                let mut file = BufReader::new(File::open(path)?);
                file.read_exact(&mut [0; 84])?;
                let (mut left, mut bytes, mut block) = (*count, Vec::new(), Vec::new());
                while left > 0 {
                    let next = left.min(BLOCK);
                    bytes.resize(50 * next as usize, 0);
                    file.read_exact(&mut bytes)?;
                    bytes.par_chunks_exact(50).map(read::facet).collect_into_vec(&mut block);
                    visit(&block);
                    left -= next;
                }
            }
            TriangleSource::Indexed(vertices, triangles) => {
                let missing = |t: &&[u32; 3]| t.iter().any(|&v| v as usize >= vertices.len());
                if let Some(triangle) = triangles.iter().find(missing) {
                    return Err(ReadError::Format(format!(
                        "there is no vertex for the triangle {triangle:?}"
                    )));
                }
                for block in triangles.chunks(BLOCK as usize) {
                    visit(&block.iter().map(|t| t.map(|v| vertices[v as usize])).collect::<Vec<_>>());
                }
            }
        }
        Ok(())
    }

    /// `count` points, spread evenly over the area.
    ///
    /// # Errors
    /// If the file cannot be read, or its area is no positive number.
    pub fn samples(&self, count: u64, seed: u64) -> Result<Vec<[f64; 3]>, ReadError> {
        let mut total = 0.0;
        self.blocks(|block| total += block.iter().map(|t| norm(normal(t))).sum::<f64>())?;
        if !(total.is_finite() && total > 0.0) {
            return Err(ReadError::Format(format!("its area is {}", 0.5 * total)));
        }
        let (step, mut rng) = (total / count as f64, Rng::new(seed));
        let (mut passed, mut next, mut points) = (0.0, rng.range(0.0, 1.0) * step, Vec::new());
        self.blocks(|block| {
            for triangle in block {
                passed += norm(normal(triangle));
                while next < passed {
                    points.push(anywhere(triangle, &mut rng));
                    next += step;
                }
            }
        })?;
        Ok(points)
    }

    /// How far each of `points` is from the nearest triangle, exactly. `reach` is how far they look at first: about the
    /// distances that are expected.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn distances(&self, points: &[[f64; 3]], mut reach: f64) -> Result<Vec<f64>, ReadError> {
        let mut distances = vec![f64::INFINITY; points.len()];
        let mut waiting: Vec<usize> = (0..points.len()).collect();
        while !waiting.is_empty() && reach.is_finite() {
            let grid = Grid::new(waiting.iter().map(|&n| points[n]).collect(), reach);
            self.blocks(|block| block.par_iter().for_each(|triangle| grid.pass(triangle)))?;
            for (&n, distance) in waiting.iter().zip(grid.distances()) {
                distances[n] = distance;
            }
            // Farther than that, a triangle may have passed unseen.
            waiting.retain(|&n| distances[n] > reach);
            reach *= 8.0;
        }
        Ok(distances)
    }
}

/// Points in the cells of a grid, and the nearest triangle that has passed.
struct Grid {
    points: Vec<V3>,
    /// Squares of distances as bits, which are in the order of the numbers as none is negative.
    nearest: Vec<AtomicU64>,
    reach: f64,
    cell: f64,
    low: V3,
    cells: [usize; 3],
    /// Where each cell's points begin in `order`.
    starts: Vec<u32>,
    order: Vec<u32>,
}

/// Cells along the longest side at most: 200³ of four bytes are 32 MB.
const CELLS_MAX: f64 = 200.0;

impl Grid {
    fn new(points: Vec<V3>, reach: f64) -> Grid {
        let low: V3 = std::array::from_fn(|k| points.iter().fold(f64::INFINITY, |m, p| m.min(p[k])));
        let size: V3 =
            std::array::from_fn(|k| points.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p[k])) - low[k]);
        let cell = size.iter().fold(reach, |m, s| m.max(s / CELLS_MAX));
        let cells = size.map(|s| (s / cell) as usize + 1);
        let nearest = points.iter().map(|_| AtomicU64::new(f64::INFINITY.to_bits())).collect();
        let mut grid =
            Grid { points, nearest, reach, cell, low, cells, starts: Vec::new(), order: Vec::new() };
        let of = |p: &V3| {
            let at: [usize; 3] = std::array::from_fn(|k| ((p[k] - low[k]) / cell) as usize);
            grid.number(at)
        };
        let mut order: Vec<(u32, u32)> = (0..).zip(&grid.points).map(|(n, p)| (of(p) as u32, n)).collect();
        order.sort_unstable();
        let mut starts = vec![0; cells.iter().product::<usize>() + 1];
        order.iter().for_each(|&(cell, _)| starts[cell as usize + 1] += 1);
        (1..starts.len()).for_each(|n| starts[n] += starts[n - 1]);
        (grid.starts, grid.order) = (starts, order.into_iter().map(|(_, n)| n).collect());
        grid
    }

    fn number(&self, at: [usize; 3]) -> usize {
        (at[2] * self.cells[1] + at[1]) * self.cells[0] + at[0]
    }

    /// A triangle passes; large ones in parts, whose boxes have fewer cells.
    fn pass(&self, triangle: &[V3; 3]) {
        let [a, b, c] = *triangle;
        let edges = [sub(b, a), sub(c, b), sub(a, c)].map(norm);
        let longest = (1..3).fold(0, |l, n| if edges[n] > edges[l] { n } else { l });
        if edges[longest] <= 2.0 * self.cell {
            return self.pass_whole(triangle);
        }
        let Some(_) = self.cells_near(triangle) else { return };
        let [from, to, apex] = std::array::from_fn(|n| triangle[(longest + n) % 3]);
        let middle: V3 = std::array::from_fn(|k| f64::midpoint(from[k], to[k]));
        self.pass(&[from, middle, apex]);
        self.pass(&[middle, to, apex]);
    }

    fn pass_whole(&self, triangle: &[V3; 3]) {
        let Some([from, to]) = self.cells_near(triangle) else { return };
        for z in from[2]..=to[2] {
            for y in from[1]..=to[1] {
                let row =
                    self.starts[self.number([from[0], y, z])]..self.starts[self.number([to[0], y, z]) + 1];
                for &n in &self.order[row.start as usize..row.end as usize] {
                    let off = sub(nearest_of(triangle, self.points[n as usize]), self.points[n as usize]);
                    let square = dot(off, off);
                    // Triangles without area may be nowhere.
                    if square >= 0.0 {
                        self.nearest[n as usize].fetch_min(square.to_bits(), Ordering::Relaxed);
                    }
                }
            }
        }
    }

    /// The first and the last cell along each axis that a triangle's points in reach can be in.
    fn cells_near(&self, triangle: &[V3; 3]) -> Option<[[usize; 3]; 2]> {
        let mut range = [[0; 3]; 2];
        for k in 0..3 {
            let low = triangle.iter().fold(f64::INFINITY, |m, v| m.min(v[k])) - self.reach - self.low[k];
            let high = triangle.iter().fold(f64::NEG_INFINITY, |m, v| m.max(v[k])) + self.reach - self.low[k];
            let last = self.cells[k] - 1;
            if !(high >= 0.0 && low < (last + 1) as f64 * self.cell) {
                return None;
            }
            // Negative numbers become 0.
            range[0][k] = ((low / self.cell) as usize).min(last);
            range[1][k] = ((high / self.cell) as usize).min(last);
        }
        Some(range)
    }

    fn distances(&self) -> impl Iterator<Item = f64> + '_ {
        self.nearest.iter().map(|bits| f64::from_bits(bits.load(Ordering::Relaxed)).sqrt())
    }
}

/// What a set of distances comes to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DistanceStatistics {
    /// How many there are.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// The root of the mean of their squares.
    pub rms: f64,
    /// The smallest that at least 999 of 1000 do not exceed.
    pub p999: f64,
    /// The largest.
    pub max: f64,
    /// Where it is.
    pub at: [f64; 3],
    /// How many of them are where no wall and no gap is thin.
    pub clear: usize,
    /// The smallest that at least 999 of 1000 of those do not exceed.
    pub clear_p999: f64,
    /// The largest of those.
    pub clear_max: f64,
}

impl DistanceStatistics {
    /// Sums up distances at points. `is_thin` says, by number, whether a wall or a gap is thin there.
    pub fn of(
        points: &[[f64; 3]],
        distances: &[f64],
        is_thin: impl Fn(usize) -> bool + Sync,
    ) -> DistanceStatistics {
        let count = distances.len();
        let sorted = |mut of: Vec<f64>| {
            of.sort_unstable_by(f64::total_cmp);
            of
        };
        let p999 = |sorted: &[f64]| sorted.get((sorted.len() * 999).div_ceil(1000).max(1) - 1).copied();
        let all = sorted(distances.to_vec());
        let clear = (0..count).into_par_iter().filter(|&n| !is_thin(n)).map(|n| distances[n]).collect();
        let clear = sorted(clear);
        let Some(&max) = all.last() else { return DistanceStatistics::default() };
        DistanceStatistics {
            count,
            mean: all.iter().sum::<f64>() / count as f64,
            rms: (all.iter().map(|d| d * d).sum::<f64>() / count as f64).sqrt(),
            p999: p999(&all).unwrap_or(0.0),
            max,
            at: points[distances.iter().position(|&d| d == max).unwrap_or(0)],
            clear: clear.len(),
            clear_p999: p999(&clear).unwrap_or(0.0),
            clear_max: clear.last().copied().unwrap_or(0.0),
        }
    }
}

/// What is asked about a mesh.
#[derive(Clone, Copy, Debug)]
pub struct DistanceQuery {
    /// Points on the mesh, and candidates for points on the boundary.
    pub samples: u64,
    /// Points on creases; 0 for none.
    pub crease_samples: u64,
    /// Faces that meet at less than this many degrees form no crease.
    pub crease_degrees: f64,
    /// Of the random numbers.
    pub seed: u64,
    /// The edge of the mesh's cells, or how far it is expected to be off, in the soup's unit.
    pub cell: f64,
    /// Walls and gaps thinner than this are thin.
    pub thin: f64,
}

/// How far a mesh and the boundary of a union are from each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshComparison {
    /// From points of the mesh to the boundary.
    pub mesh: DistanceStatistics,
    /// From points of the boundary to the mesh.
    pub boundary: DistanceStatistics,
    /// From points on creases of the boundary to the mesh.
    pub creases: Option<DistanceStatistics>,
}

/// Compares a mesh with the boundary of a union.
///
/// # Errors
/// If the mesh cannot be read, or one of the two has no area.
pub fn compare(
    union: &Union,
    mesh: &TriangleSource,
    asked: &DistanceQuery,
) -> Result<MeshComparison, ReadError> {
    let boundary = union.samples(asked.samples, asked.seed);
    if boundary.is_empty() {
        return Err(ReadError::Format("the soup encloses nothing: no facet of it is a boundary".into()));
    }
    let points = mesh.samples(asked.samples, asked.seed)?;
    let resolution = 0.02 * asked.cell;
    let found: Vec<_> = points.par_iter().filter_map(|&p| union.nearest(p, resolution)).collect();
    let distances: Vec<f64> = found.iter().map(|nearest| nearest.distance).collect();
    let is_thin = |n: usize| union.is_thin(&found[n].point, asked.thin);
    let of_mesh = DistanceStatistics::of(&points, &distances, is_thin);
    let points: Vec<V3> = boundary.iter().map(|point| point.at).collect();
    let is_thin = |n: usize| union.is_thin(&boundary[n], asked.thin);
    let distances = mesh.distances(&points, asked.cell)?;
    let of_boundary = DistanceStatistics::of(&points, &distances, is_thin);
    let mut comparison = MeshComparison { mesh: of_mesh, boundary: of_boundary, creases: None };
    if asked.crease_samples > 0 {
        let points = union.creases(asked.crease_samples, asked.crease_degrees, asked.seed);
        let distances = mesh.distances(&points, asked.cell)?;
        comparison.creases = Some(DistanceStatistics::of(&points, &distances, |_| false));
    }
    Ok(comparison)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mesh;
    use crate::pile::random_pile;
    use crate::shapes::{cuboid, icosphere};

    fn held(mesh: &Mesh) -> TriangleSource {
        TriangleSource::Indexed(mesh.vertices.clone(), mesh.triangles.clone())
    }

    fn question(cell: f64) -> DistanceQuery {
        DistanceQuery {
            samples: 10_000,
            crease_samples: 2_000,
            crease_degrees: 20.0,
            seed: 1,
            cell,
            thin: 0.5,
        }
    }

    /// A mesh that is the truth moved outward by a known distance.
    #[test]
    fn a_planted_offset_is_found() {
        let box_of = |s: f64| cuboid([-s; 3], [10.0 + s; 3]);
        let union = Union::new(box_of(0.0).soup());
        let told = compare(&union, &held(&box_of(0.1)), &question(0.2)).unwrap();
        assert!(
            (told.boundary.max - 0.1).abs() < 1e-9 && (told.boundary.mean - 0.1).abs() < 1e-9,
            "{told:?}"
        );
        assert!((told.mesh.p999 - 0.1).abs() < 0.05 && told.mesh.max < 0.1 * 1.74, "{told:?}");
        // The large one's edges are 0.14 away, and its faces 0.1.
        let creases = told.creases.unwrap();
        assert!((creases.mean - 0.1).abs() < 1e-9 && creases.count > 1900, "{creases:?}");
        assert_eq!(told.boundary.clear, told.boundary.count);
        let same = compare(&union, &held(&box_of(0.0)), &question(0.2)).unwrap();
        assert!(same.mesh.max < 1e-12 && same.boundary.max < 1e-12, "{same:?}");
    }

    /// Two boxes that overlap: their soup is no mesh of the union, as its inner parts are far from the boundary.
    #[test]
    fn what_is_buried_is_far_from_the_boundary_and_dents_are_found() {
        let boxes = [cuboid([0.0; 3], [10.0; 3]), cuboid([5.0, 2.0, 2.0], [15.0, 8.0, 8.0])];
        let soup = Mesh::merged(&boxes);
        let union = Union::new(soup.soup());
        let told = compare(&union, &held(&soup), &question(0.2)).unwrap();
        assert!(told.boundary.max < 1e-12, "{told:?}");
        // Halfway along the buried sides, and in the middle of the buried end: 2 from the large one's sides to 5.
        assert!((4.8..5.3).contains(&told.mesh.max), "{told:?}");
        let other = Union::new(cuboid([0.0; 3], [10.0; 3]).soup());
        let told = compare(&other, &held(&soup), &question(0.2)).unwrap();
        assert!((4.9..=5.01).contains(&told.mesh.max), "{told:?}");
    }

    /// A mesh that has lost a thin wall.
    #[test]
    fn a_lost_wall_is_told_as_thin() {
        let block = cuboid([0.0; 3], [10.0; 3]);
        let wall = cuboid([12.0, 0.0, 0.0], [12.2, 10.0, 10.0]);
        let union = Union::new(Mesh::merged(&[block.clone(), wall]).soup());
        let told = compare(&union, &held(&block), &question(0.4)).unwrap();
        assert!((2.0..2.21).contains(&told.boundary.max), "{told:?}");
        // The wall is thin but at its narrow sides, 8 of 208 of it and of 808 of all, which it is 10 thick behind.
        let clear = told.boundary.clear as f64 / told.boundary.count as f64;
        assert!((clear - 608.0 / 808.0).abs() < 0.01 && told.boundary.clear_max > 1.9, "{told:?}");
        let asked = DistanceQuery { thin: 0.1, ..question(0.4) };
        assert_eq!(compare(&union, &held(&block), &asked).unwrap().boundary.clear, told.boundary.count);
        assert!(told.mesh.max < 1e-12);
    }

    /// Against all triangles, one by one, whatever the first reach.
    #[test]
    fn distances_to_a_mesh_are_those_of_its_nearest_triangle() {
        let mesh = Mesh::merged(&[icosphere(3, 4.0), cuboid([-30.0, -1.0, 5.0], [40.0, 1.0, 6.0])]);
        let pile = Mesh::merged(&random_pile(9, 8));
        let points: Vec<V3> = pile.vertices.iter().step_by(5).copied().collect();
        for reach in [1e-3, 0.5, 100.0] {
            let told = held(&mesh).distances(&points, reach).unwrap();
            for (p, told) in points.iter().zip(told) {
                let nearest =
                    mesh.facets().map(|t| norm(sub(nearest_of(&t, *p), *p))).fold(f64::MAX, f64::min);
                assert!((nearest - told).abs() < 1e-9, "{p:?}: {told}, {nearest}");
            }
        }
    }

    #[test]
    fn the_numbers_are_those_of_the_distances() {
        let distances: Vec<f64> = (1..=2000).map(|n| f64::from(n) / 1000.0).collect();
        let points: Vec<V3> = distances.iter().map(|&d| [d; 3]).collect();
        let told = DistanceStatistics::of(&points, &distances, |n| n >= 1000);
        assert_eq!((told.count, told.max, told.p999, told.at), (2000, 2.0, 1.998, [2.0; 3]));
        assert_eq!((told.clear, told.clear_max, told.clear_p999), (1000, 1.0, 0.999));
        assert!((told.mean - 1.0005).abs() < 1e-12 && (told.rms - 1.155).abs() < 1e-3);
        assert_eq!(DistanceStatistics::of(&[], &[], |_| true), DistanceStatistics::default());
    }

    #[test]
    fn files_are_read_in_blocks_and_refused_if_they_are_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sphere.stl");
        // More than a block.
        let mesh = icosphere(7, 10.0);
        crate::write::stl(std::io::BufWriter::new(File::create(&path).unwrap()), &mesh).unwrap();
        let triangles = TriangleSource::open(&path).unwrap();
        assert_eq!(triangles.count(), 327_680);
        let (file, memory) = (triangles.samples(1000, 2).unwrap(), held(&mesh).samples(1000, 2).unwrap());
        assert_eq!((file.len(), memory.len()), (1000, 1000));
        assert!(held(&mesh).distances(&file, 1e-3).unwrap().iter().all(|&d| d < 1e-5));
        std::fs::write(&path, [0; 83]).unwrap();
        assert!(TriangleSource::open(&path).is_err());
        std::fs::write(&path, [0; 84]).unwrap();
        assert!(matches!(TriangleSource::open(&path), Err(ReadError::Format(_))));
        let broken = TriangleSource::Indexed(vec![[0.0; 3]], vec![[0, 1, 2]]);
        assert!(broken.samples(10, 1).is_err());
    }
}
