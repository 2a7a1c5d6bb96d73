//! Is it a closed, oriented, manifold surface? An independent check of an indexed mesh.
//!
//! Half-edges are sorted into one bucket per lower vertex, so that all uses of an edge lie next to each other;
//! fans and components are two union-find passes over the result. Linear in time and about 60 bytes a triangle: a
//! 250 MB STL file of 5 million facets takes 2.4 s on one core, reading and welding included.

use crate::StlFacet;
use crate::judge::read::{self, ReadError};
use crate::judge::weld;
use crate::vector::{cross, dot, norm, sub};
use std::fmt;
use std::path::Path;

/// What [`check`] found. Counts of what is wrong are 0 for a good mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshFindings {
    /// Vertices that a triangle refers to.
    pub vertices: u64,
    /// Vertices that no triangle refers to.
    pub unused_vertices: u64,
    /// All triangles, the broken ones included.
    pub triangles: u64,
    /// Undirected edges.
    pub edges: u64,
    /// Edges used by an odd number of triangles: the border of the surface.
    pub open_edges: u64,
    /// Edges whose triangles do not run along it equally often in each direction, though they could.
    pub misoriented_edges: u64,
    /// Edges of more than two triangles.
    pub crowded_edges: u64,
    /// Vertices whose triangles form more than one fan.
    pub split_vertices: u64,
    /// Triangles that refer to one vertex twice, or to none: left out of all counts of edges and fans.
    pub repeated_index_triangles: u64,
    /// Triangles with three different vertices and no area.
    pub zero_area_triangles: u64,
    /// Triangles with the same three vertices as an earlier one, in any order.
    pub duplicate_triangles: u64,
    /// Vertices that are not finite numbers.
    pub non_finite_vertices: u64,
    /// Parts that are connected across edges.
    pub components: u64,
    /// Vertices − edges + triangles.
    pub euler_characteristic: i64,
    /// Total area.
    pub area: f64,
    /// Enclosed volume, negative if inside out.
    pub signed_volume: f64,
    /// Lower corner of the bounding box.
    pub min: [f64; 3],
    /// Upper corner of the bounding box.
    pub max: [f64; 3],
}

impl MeshFindings {
    /// The surface has no border.
    pub fn is_closed(&self) -> bool {
        self.open_edges == 0
    }

    /// Neighbouring triangles agree on which side is outside.
    pub fn is_oriented(&self) -> bool {
        self.misoriented_edges == 0
    }

    /// Closed and oriented: every directed edge has its opposite, so winding numbers are integers.
    pub fn is_balanced(&self) -> bool {
        self.is_closed() && self.is_oriented()
    }

    /// No edge has more than two triangles.
    pub fn is_edge_manifold(&self) -> bool {
        self.crowded_edges == 0
    }

    /// The triangles of every vertex form one fan.
    pub fn is_vertex_manifold(&self) -> bool {
        self.split_vertices == 0
    }

    /// No triangle is degenerate or there twice, no vertex is unused or not a number.
    pub fn is_clean(&self) -> bool {
        self.repeated_index_triangles == 0
            && self.zero_area_triangles == 0
            && self.duplicate_triangles == 0
            && self.unused_vertices == 0
            && self.non_finite_vertices == 0
    }

    /// Closed, oriented and manifold. Says nothing about degenerate triangles: see [`MeshFindings::is_clean`].
    pub fn is_closed_manifold(&self) -> bool {
        self.is_balanced()
            && self.is_edge_manifold()
            && self.is_vertex_manifold()
            && self.repeated_index_triangles == 0
    }

    /// Sum of the components' genera; `None` unless the mesh is a closed manifold.
    pub fn genus(&self) -> Option<i64> {
        self.is_closed_manifold().then_some(self.components as i64 - self.euler_characteristic / 2)
    }
}

impl fmt::Display for MeshFindings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} triangles, {} vertices, {} edges, {} components, Euler characteristic {}",
            self.triangles, self.vertices, self.edges, self.components, self.euler_characteristic
        )?;
        writeln!(
            f,
            "edges: {} open, {} misoriented, {} of more than two triangles; {} vertices of several fans",
            self.open_edges, self.misoriented_edges, self.crowded_edges, self.split_vertices
        )?;
        writeln!(
            f,
            "triangles: {} repeat a vertex, {} have no area, {} are there already; vertices: {} unused, {} not finite",
            self.repeated_index_triangles,
            self.zero_area_triangles,
            self.duplicate_triangles,
            self.unused_vertices,
            self.non_finite_vertices
        )?;
        write!(f, "area {}, volume {}, from {:?} to {:?}", self.area, self.signed_volume, self.min, self.max)
    }
}

/// Checks the mesh of an STL (binary, welded by exact bits), PLY (binary little-endian) or OBJ file.
///
/// # Errors
/// If the file cannot be read as the kind its ending names.
pub fn check_file(path: &Path) -> Result<MeshFindings, ReadError> {
    Ok(match read::read(path)? {
        read::FileMesh::Soup(facets) => check_soup(&facets),
        read::FileMesh::Indexed(vertices, triangles) => check(&vertices, &triangles),
    })
}

/// Checks a soup after welding its corners by exact f32 bits.
pub fn check_soup(facets: &[StlFacet]) -> MeshFindings {
    let (vertices, triangles) = weld(facets);
    check(&vertices, &triangles)
}

/// Checks an indexed mesh. An index without a vertex counts as a repeated one.
pub fn check(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> MeshFindings {
    let sound = |t: &[u32; 3]| {
        let [a, b, c] = *t;
        a != b && b != c && c != a && t.iter().all(|&v| (v as usize) < vertices.len())
    };
    let whole: Vec<[u32; 3]> = triangles.iter().filter(|t| sound(t)).copied().collect();
    let mut report = MeshFindings {
        triangles: triangles.len() as u64,
        repeated_index_triangles: (triangles.len() - whole.len()) as u64,
        ..MeshFindings::default()
    };
    count_vertices(vertices, triangles, &mut report);
    count_duplicates(vertices.len(), &whole, &mut report);
    count_edges(vertices.len(), &whole, &mut report);
    measure(vertices, &whole, &mut report);
    report.euler_characteristic = report.vertices as i64 - report.edges as i64 + whole.len() as i64;
    report
}

fn count_vertices(vertices: &[[f64; 3]], triangles: &[[u32; 3]], report: &mut MeshFindings) {
    let mut used = vec![false; vertices.len()];
    for &v in triangles.iter().flatten() {
        if let Some(used) = used.get_mut(v as usize) {
            *used = true;
        }
    }
    report.vertices = used.iter().filter(|&&u| u).count() as u64;
    report.unused_vertices = vertices.len() as u64 - report.vertices;
    (report.min, report.max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for v in vertices {
        report.non_finite_vertices += u64::from(v.iter().any(|c| !c.is_finite()));
        for (a, &c) in v.iter().enumerate() {
            report.min[a] = report.min[a].min(c);
            report.max[a] = report.max[a].max(c);
        }
    }
}

/// Sorts `(bucket, value)` pairs by bucket and then by value: a counting sort, then a short sort in each
/// bucket. `items` is called twice and must repeat itself.
fn bucketed<I: Iterator<Item = (u32, u64)>>(buckets: usize, items: impl Fn() -> I) -> (Vec<u32>, Vec<u64>) {
    let mut starts = vec![0u32; buckets + 1];
    for (bucket, _) in items() {
        starts[bucket as usize + 1] += 1;
    }
    for i in 0..buckets {
        starts[i + 1] += starts[i];
    }
    let mut next = starts.clone();
    let mut values = vec![0u64; starts[buckets] as usize];
    for (bucket, value) in items() {
        values[next[bucket as usize] as usize] = value;
        next[bucket as usize] += 1;
    }
    for range in starts.windows(2) {
        values[range[0] as usize..range[1] as usize].sort_unstable();
    }
    (starts, values)
}

fn count_duplicates(vertex_count: usize, triangles: &[[u32; 3]], report: &mut MeshFindings) {
    let keys = || {
        triangles.iter().map(|t| {
            let mut t = *t;
            t.sort_unstable();
            (t[0], u64::from(t[1]) << 32 | u64::from(t[2]))
        })
    };
    let (starts, values) = bucketed(vertex_count, keys);
    for range in starts.windows(2) {
        let bucket = &values[range[0] as usize..range[1] as usize];
        report.duplicate_triangles += bucket.windows(2).filter(|pair| pair[0] == pair[1]).count() as u64;
    }
}

/// Edges, fans and components. Corner `3·t + i` of triangle t stands for its vertex i and for the half-edge from
/// there to the next vertex.
fn count_edges(vertex_count: usize, triangles: &[[u32; 3]], report: &mut MeshFindings) {
    let half_edges = || {
        triangles.iter().enumerate().flat_map(|(t, v)| {
            (0..3).map(move |i| {
                let (from, to) = (v[i], v[(i + 1) % 3]);
                (from.min(to), u64::from(from.max(to)) << 32 | (3 * t + i) as u64)
            })
        })
    };
    let (starts, values) = bucketed(vertex_count, half_edges);
    let mut fans = Sets::new(3 * triangles.len());
    let mut parts = Sets::new(triangles.len());
    for (low, range) in starts.windows(2).enumerate() {
        let bucket = &values[range[0] as usize..range[1] as usize];
        for uses in bucket.chunk_by(|a, b| a >> 32 == b >> 32) {
            count_edge(low as u32, uses, triangles, report);
            let first = Corners::at_edge(uses[0] as u32, low as u32, triangles);
            for &other in &uses[1..] {
                let other = Corners::at_edge(other as u32, low as u32, triangles);
                fans.unite(first.low, other.low);
                fans.unite(first.high, other.high);
                parts.unite(first.low / 3, other.low / 3);
            }
        }
    }
    report.components = parts.roots().count() as u64;
    let mut fan_count = vec![0u8; vertex_count];
    for corner in fans.roots() {
        let vertex = triangles[corner as usize / 3][corner as usize % 3];
        let fans = &mut fan_count[vertex as usize];
        report.split_vertices += u64::from(*fans == 1);
        *fans = fans.saturating_add(1);
    }
}

fn count_edge(low: u32, uses: &[u64], triangles: &[[u32; 3]], report: &mut MeshFindings) {
    let forward = uses
        .iter()
        .filter(|&&half_edge| {
            let corner = half_edge as u32 as usize;
            triangles[corner / 3][corner % 3] == low
        })
        .count();
    let surplus = forward.abs_diff(uses.len() - forward);
    report.edges += 1;
    report.open_edges += u64::from(uses.len() % 2 == 1);
    report.misoriented_edges += u64::from(surplus > uses.len() % 2);
    report.crowded_edges += u64::from(uses.len() > 2);
}

/// A triangle's corners at the two ends of one of its edges.
struct Corners {
    low: u32,
    high: u32,
}

impl Corners {
    fn at_edge(half_edge: u32, low_vertex: u32, triangles: &[[u32; 3]]) -> Corners {
        let (triangle, i) = (half_edge / 3, half_edge % 3);
        let next = 3 * triangle + (i + 1) % 3;
        if triangles[triangle as usize][i as usize] == low_vertex {
            Corners { low: half_edge, high: next }
        } else {
            Corners { low: next, high: half_edge }
        }
    }
}

/// Disjoint sets of 0..n; the smaller root wins, paths are halved on the way (Tarjan & van Leeuwen 1984).
struct Sets(Vec<u32>);

impl Sets {
    fn new(n: usize) -> Sets {
        Sets((0..n as u32).collect())
    }

    fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            let up = self.0[self.0[i as usize] as usize];
            self.0[i as usize] = up;
            i = up;
        }
        i
    }

    fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }

    fn roots(&self) -> impl Iterator<Item = u32> + '_ {
        self.0.iter().enumerate().filter(|&(i, &up)| i as u32 == up).map(|(i, _)| i as u32)
    }
}

fn measure(vertices: &[[f64; 3]], triangles: &[[u32; 3]], report: &mut MeshFindings) {
    // Relative to the middle, or the volume of a small part far out drowns in rounding.
    let middle: [f64; 3] = std::array::from_fn(|a| 0.5 * (report.min[a] + report.max[a]));
    for t in triangles {
        let [a, b, c] = t.map(|v| sub(vertices[v as usize], middle));
        let normal = cross(sub(b, a), sub(c, a));
        report.zero_area_triangles += u64::from(normal == [0.0; 3]);
        report.area += 0.5 * norm(normal);
        report.signed_volume += dot(a, cross(b, c)) / 6.0;
    }
}
