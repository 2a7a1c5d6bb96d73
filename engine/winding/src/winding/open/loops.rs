//! The boundary as simple loops.

use super::boundary::OpenEdge;
use crate::lattice::Units;

/// Simple loops of vertices, three or more each, one after the other.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Loops {
    vertices: Vec<Units>,
    ends: Vec<usize>,
}

/// Edges tried at a vertex to find a loop of three. Facets that share a hub with many others are found from
/// their other two vertices.
const TRIES: usize = 16;

/// No position.
const NONE: u32 = u32::MAX;

/// The open edges by the vertex that they start from.
struct Graph {
    vertices: Vec<Units>,
    /// Where each vertex's edges begin in `targets`.
    starts: Vec<usize>,
    /// Ends of the edges, ascending for each start.
    targets: Vec<u32>,
    used: Vec<bool>,
    /// Per vertex: the edges before this one are used.
    next: Vec<usize>,
}

impl Graph {
    /// From sorted edges.
    fn new(edges: &[OpenEdge]) -> Graph {
        let mut vertices: Vec<Units> = edges.iter().map(|e| e.from).collect();
        vertices.dedup();
        let number = |p: Units| vertices.binary_search(&p).expect("an edge starts wherever one ends");
        let targets = edges.iter().map(|e| number(e.to) as u32).collect();
        let mut starts = Vec::with_capacity(vertices.len() + 1);
        let mut at = 0;
        for chunk in edges.chunk_by(|a, b| a.from == b.from) {
            starts.push(at);
            at += chunk.len();
        }
        starts.push(at);
        let next = starts[..vertices.len()].to_vec();
        Graph { vertices, starts, targets, used: vec![false; edges.len()], next }
    }

    /// The unused edges that start at a vertex.
    fn unused(&self, v: u32) -> impl Iterator<Item = usize> + '_ {
        let v = v as usize;
        (self.next[v]..self.starts[v + 1]).filter(|&e| !self.used[e])
    }

    /// An unused edge from one vertex to another.
    fn between(&self, from: u32, to: u32) -> Option<usize> {
        let (first, end) = (self.starts[from as usize], self.starts[from as usize + 1]);
        let at = first + self.targets[first..end].partition_point(|&t| t < to);
        (at..end).take_while(|&e| self.targets[e] == to).find(|&e| !self.used[e])
    }

    /// Takes the next unused edge from a vertex and says where it ends.
    fn take(&mut self, v: u32) -> Option<u32> {
        let edge = self.unused(v).next()?;
        self.used[edge] = true;
        self.next[v as usize] = edge + 1;
        Some(self.targets[edge])
    }
}

impl Loops {
    /// Splits a boundary, whose edges are sorted, into simple loops: first those of three edges, so that an isolated
    /// facet is a loop of its own whatever vertices it shares. The others are found by walking until a vertex comes
    /// back, which keeps loops short.
    pub fn trace(edges: &[OpenEdge]) -> Loops {
        let mut graph = Graph::new(edges);
        let mut loops = Loops::default();
        loops.take_threes(&mut graph);
        loops.walk(&mut graph);
        loops
    }

    /// Number of loops.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// The vertices of each loop in order.
    pub fn iter(&self) -> impl Iterator<Item = &[Units]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.vertices[start..end])
    }

    fn push(&mut self, graph: &Graph, path: &[u32]) {
        self.vertices.extend(path.iter().map(|&v| graph.vertices[v as usize]));
        self.ends.push(self.vertices.len());
    }

    fn take_threes(&mut self, graph: &mut Graph) {
        for a in 0..graph.vertices.len() as u32 {
            for first in graph.starts[a as usize]..graph.starts[a as usize + 1] {
                let b = graph.targets[first];
                if graph.used[first] {
                    continue;
                }
                let close = |second: usize| {
                    let c = graph.targets[second];
                    graph.between(c, a).map(|third| (second, c, third))
                };
                let found = graph.unused(b).take(TRIES).find_map(close);
                if let Some((second, c, third)) = found {
                    [first, second, third].iter().for_each(|&e| graph.used[e] = true);
                    self.push(graph, &[a, b, c]);
                }
            }
        }
    }

    /// As many edges end at a vertex as start there, so a walk can only get stuck where it began.
    fn walk(&mut self, graph: &mut Graph) {
        let mut place = vec![NONE; graph.vertices.len()];
        let mut path = Vec::new();
        for start in 0..graph.vertices.len() as u32 {
            path.push(start);
            place[start as usize] = 0;
            while let Some(v) = path.last().and_then(|&last| graph.take(last)) {
                let seen = place[v as usize];
                if seen == NONE {
                    place[v as usize] = path.len() as u32;
                    path.push(v);
                    continue;
                }
                let from = seen as usize;
                self.push(graph, &path[from..]);
                path.drain(from + 1..).for_each(|w| place[w as usize] = NONE);
            }
            debug_assert_eq!(path, [start]);
            place[start as usize] = NONE;
            path.clear();
        }
    }
}
