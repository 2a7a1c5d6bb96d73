//! Edges, fans and duplicates, vertex by vertex.
//!
//! One table lists the corners at every vertex (12 bytes a triangle). All that is to be known of an edge stands at
//! its lower vertex, and whether a vertex has one fan at the vertex itself, so vertices are studied on all threads
//! independently of each other.

use super::tally::Tally;
use super::{CHUNK, Mesh, is_whole};
use crate::error::Result;
use crate::progress::Progress;
use rayon::prelude::*;
use std::sync::atomic::{AtomicI8, AtomicU32, Ordering::Relaxed};

/// What the vertices tell.
pub(super) struct Topology {
    pub(super) vertices: u64,
    pub(super) edges: u64,
    pub(super) open: Tally,
    pub(super) misoriented: Tally,
    pub(super) crowded: Tally,
    pub(super) split: Tally,
    pub(super) duplicates: Tally,
    /// Triangles that are neither whole nor left out.
    pub(super) collapsed: Tally,
    /// Which triangles hang together by edges.
    pub(super) patches: ConcurrentSets,
    /// Of each whole triangle 1, less the edges and more the fans that are counted with it.
    pub(super) euler: Vec<i8>,
}

/// Disjoint sets of triangles, united by several threads at once. A set is named by its lowest triangle, so the outcome
/// does not depend on who comes first.
pub(super) struct ConcurrentSets(Vec<AtomicU32>);

impl ConcurrentSets {
    fn new(triangles: usize) -> ConcurrentSets {
        ConcurrentSets((0..triangles as u32).into_par_iter().map(AtomicU32::new).collect())
    }

    /// The lowest triangle of the set, as far as sets are united by now.
    pub(super) fn root(&self, mut triangle: u32) -> u32 {
        loop {
            let up = self.0[triangle as usize].load(Relaxed);
            if up == triangle {
                return triangle;
            }
            let next = self.0[up as usize].load(Relaxed);
            // Halves the path. Should another thread be faster, the path is no longer than before.
            let _ = self.0[triangle as usize].compare_exchange_weak(up, next, Relaxed, Relaxed);
            triangle = next;
        }
    }

    fn unite(&self, a: u32, b: u32) {
        let (mut a, mut b) = (self.root(a), self.root(b));
        while a != b {
            let (low, high) = (a.min(b), a.max(b));
            // Links point down only, so there are no cycles.
            if self.0[high as usize].compare_exchange(high, low, Relaxed, Relaxed).is_ok() {
                return;
            }
            (a, b) = (self.root(low), self.root(high));
        }
    }
}

/// Corner 3t + i is corner i of triangle t.
pub struct CornerTable {
    /// Where the list of each vertex ends; it begins where that of the vertex before ends.
    ends: Vec<u32>,
    lists: Vec<u32>,
}

impl CornerTable {
    /// The corners of whole triangles by vertex, those of one vertex in any order.
    pub fn of(vertices: usize, triangles: &[[u32; 3]]) -> CornerTable {
        let next: Vec<AtomicU32> = (0..vertices + 1).into_par_iter().map(|_| AtomicU32::new(0)).collect();
        let whole = || triangles.par_iter().enumerate().with_min_len(CHUNK).filter(|(_, t)| is_whole(t));
        whole().for_each(|(_, t)| {
            for &v in t {
                next[v as usize + 1].fetch_add(1, Relaxed);
            }
        });
        let mut total = 0;
        for count in &next {
            total += count.load(Relaxed);
            count.store(total, Relaxed);
        }
        let lists: Vec<AtomicU32> = (0..total).into_par_iter().map(|_| AtomicU32::new(0)).collect();
        whole().for_each(|(number, t)| {
            for (i, &v) in t.iter().enumerate() {
                let at = next[v as usize].fetch_add(1, Relaxed);
                lists[at as usize].store((3 * number + i) as u32, Relaxed);
            }
        });
        let plain = |atomics: Vec<AtomicU32>| atomics.into_iter().map(AtomicU32::into_inner).collect();
        CornerTable { ends: plain(next), lists: plain(lists) }
    }

    /// The corners at a vertex.
    pub fn at(&self, vertex: usize) -> &[u32] {
        let begin = if vertex == 0 { 0 } else { self.ends[vertex - 1] };
        &self.lists[begin as usize..self.ends[vertex] as usize]
    }
}

/// One end of an edge in one triangle, seen from a vertex.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct EdgeEnd {
    /// The vertex at the other end.
    to: u32,
    /// The corner here, by its number in the vertex' list.
    corner: u32,
    /// Whether the triangle runs along it away from here.
    outward: bool,
}

/// What some vertices tell.
#[derive(Clone, Copy)]
struct Counts {
    vertices: u64,
    edges: u64,
    open: Tally,
    misoriented: Tally,
    crowded: Tally,
    split: Tally,
    duplicates: Tally,
}

impl Counts {
    const NONE: Counts = Counts {
        vertices: 0,
        edges: 0,
        open: Tally::NONE,
        misoriented: Tally::NONE,
        crowded: Tally::NONE,
        split: Tally::NONE,
        duplicates: Tally::NONE,
    };

    fn merged(self, other: Counts) -> Counts {
        Counts {
            vertices: self.vertices + other.vertices,
            edges: self.edges + other.edges,
            open: self.open.merged(other.open),
            misoriented: self.misoriented.merged(other.misoriented),
            crowded: self.crowded.merged(other.crowded),
            split: self.split.merged(other.split),
            duplicates: self.duplicates.merged(other.duplicates),
        }
    }
}

/// Lists that the study of one vertex fills, kept for the next.
#[derive(Default)]
struct VertexScratch {
    corners: Vec<u32>,
    spokes: Vec<EdgeEnd>,
    /// Which corners of the list hang together: each points to one before it, or to itself.
    fans: Vec<u32>,
    rims: Vec<[u32; 2]>,
}

impl VertexScratch {
    /// The first corner of the fan so far, with paths halved on the way.
    fn fan(&mut self, mut corner: u32) -> u32 {
        while self.fans[corner as usize] != corner {
            let up = self.fans[self.fans[corner as usize] as usize];
            self.fans[corner as usize] = up;
            corner = up;
        }
        corner
    }
}

struct VertexFans<'a> {
    mesh: &'a Mesh<'a>,
    corners: CornerTable,
    patches: ConcurrentSets,
    euler: Vec<AtomicI8>,
}

impl VertexFans<'_> {
    fn vertex(&self, vertex: u32, desk: &mut VertexScratch, counts: &mut Counts) {
        let corners = self.corners.at(vertex as usize);
        if corners.is_empty() {
            return;
        }
        desk.corners.clear();
        desk.corners.extend_from_slice(corners);
        desk.corners.sort_unstable();
        desk.spokes.clear();
        desk.rims.clear();
        for (number, &corner) in desk.corners.iter().enumerate() {
            let (triangle, i) = (&self.mesh.triangles[corner as usize / 3], corner as usize % 3);
            let (next, last) = (triangle[(i + 1) % 3], triangle[(i + 2) % 3]);
            desk.spokes.push(EdgeEnd { to: next, corner: number as u32, outward: true });
            desk.spokes.push(EdgeEnd { to: last, corner: number as u32, outward: false });
            if vertex < next && vertex < last {
                desk.rims.push([next.min(last), next.max(last)]);
            }
        }
        desk.spokes.sort_unstable();
        desk.rims.sort_unstable();
        let repeated = desk.rims.windows(2).filter(|pair| pair[0] == pair[1]).count();
        (0..repeated).for_each(|_| counts.duplicates.add(vertex));
        counts.vertices += 1;
        self.edges_and_fans(vertex, desk, counts);
    }

    fn edges_and_fans(&self, vertex: u32, desk: &mut VertexScratch, counts: &mut Counts) {
        desk.fans.clear();
        desk.fans.extend(0..desk.corners.len() as u32);
        let spokes = std::mem::take(&mut desk.spokes);
        for edge in spokes.chunk_by(|a, b| a.to == b.to) {
            for pair in edge.windows(2) {
                let (a, b) = (desk.fan(pair[0].corner), desk.fan(pair[1].corner));
                desk.fans[a.max(b) as usize] = a.min(b);
            }
            if vertex < edge[0].to {
                let triangle = |spoke: &EdgeEnd| desk.corners[spoke.corner as usize] / 3;
                let out = edge.iter().filter(|spoke| spoke.outward).count();
                let odd = edge.len() % 2;
                counts.edges += 1;
                counts.open.add_if(odd == 1, vertex);
                counts.misoriented.add_if(out.abs_diff(edge.len() - out) > odd, vertex);
                counts.crowded.add_if(edge.len() > 2, vertex);
                edge.windows(2).for_each(|pair| self.patches.unite(triangle(&pair[0]), triangle(&pair[1])));
                self.euler[triangle(&edge[0]) as usize].fetch_sub(1, Relaxed);
            }
        }
        desk.spokes = spokes;
        let firsts =
            desk.fans.iter().zip(&desk.corners).enumerate().filter(|(i, (fan, _))| *i as u32 == **fan);
        let mut fans = 0;
        for (_, (_, &corner)) in firsts {
            fans += 1;
            self.euler[corner as usize / 3].fetch_add(1, Relaxed);
        }
        counts.split.add_if(fans > 1, vertex);
    }
}

/// Studies all vertices.
///
/// # Errors
/// If the user interrupts.
pub(super) fn study(mesh: &Mesh, progress: &dyn Progress) -> Result<Topology> {
    let vertices = mesh.positions.len();
    progress.phase("edges", Some(vertices as u64), "vertices");
    let of_triangle = |t: &[u32; 3]| AtomicI8::new(is_whole(t).into());
    let study = VertexFans {
        mesh,
        corners: CornerTable::of(mesh.positions.len(), &mesh.triangles),
        patches: ConcurrentSets::new(mesh.triangles.len()),
        euler: mesh.triangles.par_iter().map(of_triangle).collect(),
    };
    let of_chunk = |chunk: usize| {
        progress.check()?;
        let range = chunk * CHUNK..vertices.min((chunk + 1) * CHUNK);
        let (mut desk, mut counts) = (VertexScratch::default(), Counts::NONE);
        range.clone().for_each(|vertex| study.vertex(vertex as u32, &mut desk, &mut counts));
        progress.advance(range.len() as u64);
        Ok(counts)
    };
    let chunks = (0..vertices.div_ceil(CHUNK)).into_par_iter();
    let counts = chunks.map(of_chunk).try_reduce(|| Counts::NONE, |a, b| Ok(a.merged(b)))?;
    let mut collapsed = Tally::NONE;
    for (number, triangle) in mesh.triangles.iter().enumerate() {
        collapsed.add_if(!is_whole(triangle) && *triangle != [super::LEFT_OUT; 3], number as u32);
    }
    let Counts { vertices, edges, open, misoriented, crowded, split, duplicates } = counts;
    let euler = study.euler.into_iter().map(AtomicI8::into_inner).collect();
    let patches = study.patches;
    Ok(Topology { vertices, edges, open, misoriented, crowded, split, duplicates, collapsed, patches, euler })
}
