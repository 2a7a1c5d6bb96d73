//! Contouring: from the octree of winding numbers to a closed, oriented, manifold triangle mesh.
//!
//! Dual contouring (Ju, Losasso, Schaefer & Warren 2002) in its manifold form (Schaefer, Ju & Warren 2007),
//! over leaves of any levels next to each other: one vertex per surface component in a leaf cell, one polygon
//! per sign-changing *minimal* edge. Everything is derived from one sign per lattice point and one way to cut
//! each face, known to both cells at it, so the mesh is closed, oriented, edge-manifold and vertex-manifold by
//! construction, for any signs and any tree. One pass over the leaves in Morton order makes vertices and triangles; the
//! latter wait outside of memory until the last vertex has its number, if a sink wants numbers. The mesh is never in
//! memory as a whole.
//!
//! Stages, each of which asks the field for what earlier ones have made of a leaf and of those around it; `stages` puts
//! them together, and no two files import each other:
//!
//! ```text
//! leaves ── surface ── face_ambiguity ── cells ── faces ── vertices ── polygons ── cut ── sink
//! (tree)    (signs,    (face cuts)       (QEF, Ju  (where   (numbers)   (manifold:  (tri-   (files)
//!            Hermite                      et al.    edges                Schaefer    angles)
//!            edges)                       2002)     leave)               et al. 2007)
//!                                           │          │
//!      adaptive: leaf_candidates ── find_cross_leaf ── self_intersections ── merged_vertices
//!      (Schaefer, Ju & Warren 2007: merging within a tolerance)
//! ```
//!
//! | file | owns |
//! |---|---|
//! | `options` | what to contour and how, what is refused, what comes of it |
//! | `stages` | the stages put together |
//! | `field` | the tree with its leaves and what stages have made of them, cached |
//! | `frame` | where a brick lies in the world |
//! | `leaves`, `local_index` | which leaf lies where; cells about a leaf |
//! | `topology` | how a face is cut, the loops of a plain cell |
//! | `face_ambiguity` | which way a face is cut whose signs do not tell |
//! | `planes`, `surface` | decoded Hermite edges; signs and Hermite edges of a leaf |
//! | `symmetric`, `lanes` | symmetric matrices; eight loops side by side in vectors |
//! | `qef` | where a vertex goes |
//! | `solve` | the same for eight vertices at a time |
//! | `constrained_qef` | the few that need more, eight at a time, too |
//! | `edges` | the edges of a row of cells |
//! | `cells` | active cells and vertices of a leaf |
//! | `halo` | crossings and signs about a leaf |
//! | `crease` | where the planes of a cell meet at a sharp angle |
//! | `crease_extension` | room beyond cells for vertices on creases |
//! | `corner` | vertices at corners that no single cell sees |
//! | `single_brick` | the vertices of a brick on its own, for builds |
//! | `loops` | what belongs to one loop of a cell and what to another |
//! | `transition_cells` | cells next to finer leaves |
//! | `faces`, `face_vertices` | vertices on faces; how they are named |
//! | `adaptive` | vertices that stand for several cells' |
//! | `vertices` | the vertices of a leaf as the mesh has them |
//! | `normal_sum`, `normals` | sums of unit normals; normals of vertices |
//! | `polygons` | triangles of a leaf |
//! | `envelope` | where triangles cannot meet others |
//! | `cut` | polygons into triangles, their area, volume and normals |
//! | `triangle_names`, `triangle_spool` | how triangles name vertices; triangles that wait for the numbers of vertices |
//! | `marching` | marching cubes, for comparison |
//! | `buffer_pool`, `cache` | room that is used again; what is kept within a bound |
//! | `order` | leaves in parallel, their output in order |
//! | `tagged` | triangles with the lattice edges that they are around, for measuring |
//! | `sink` | arrays; mesh files of all formats |
//! | `quality` | triangles with better angles |
//! | `tiles` | a folder of tiles: all levels, a file a node |
//! | `shells` | connected surfaces: their volumes, which lie in which, meshes of some |

mod adaptive;
mod buffer_pool;
mod cache;
mod cells;
mod constrained_qef;
mod corner;
mod crease;
mod crease_extension;
mod cut;
mod edges;
mod envelope;
mod face_ambiguity;
mod face_vertices;
mod faces;
mod field;
mod forecast;
mod frame;
mod halo;
mod lanes;
mod leaves;
mod local_index;
mod loops;
mod marching;
mod normal_sum;
mod normals;
mod options;
mod order;
mod planes;
mod polygons;
mod qef;
mod quality;
mod shells;
mod single_brick;
mod sink;
mod solve;
mod stages;
mod surface;
mod symmetric;
mod tagged;
#[cfg(test)]
mod tests;
mod tiles;
mod topology;
mod transition_cells;
mod triangle_names;
mod triangle_spool;
mod vertices;

pub use cut::{Cuts, MeshTriangle};
pub use forecast::foresee_triangles;
pub use options::{ContourMethod, ContourOptions, MeshSummary};
pub use quality::{IMPROVED_BYTES_A_TRIANGLE, ImprovedSink};
pub use shells::{Angles, KeptCounts, NestingSink, SHELL_BYTES_A_VERTEX, Shell, ShellFilter, ShellSink};
pub use single_brick::{SingleBrick, SingleBrickCells, has_one_sheet};
pub use sink::{
    Coordinates, DOUBLE_ENDINGS, DiscardSink, FaceAttributes, FaceColumns, GlbFacesSink, GlbSink, MeshArrays,
    MeshChunk, MeshEncoding, MeshSink, NUMBER_ENDINGS, NumbersOf, PlacedSink, PositionsSink, ThreeMfParts,
    TriangleBytes, VertexBytes, VtpFile, create_sink, create_sink_with_normals, listed_mesh_endings, placed,
    ply_faces, vtp_corners, write_triangles, written_mesh_endings,
};

pub use tagged::{Bend, EdgeFacet, edge_facets};
pub use tiles::{TilesSummary, write_tiles};

use crate::error::{Error, Result};
use crate::part::temporary::require_folder;
use crate::progress::Progress;
use crate::store::BrickTree;
use buffer_pool::BufferPool;
use field::LevelSet;
use frame::united;
use normals::LeafNormals;
use options::{level, require_half, require_resolution, require_tolerance};
use order::in_order;
use polygons::{FacetOptions, LeafFacets};
use triangle_spool::{NumberedTriangles, Numbering, SpooledTriangles, TriangleSpool};
use vertices::LeafVertices;

/// Contours w = `options.iso` of `tree` into `sink`, which gets all vertices, then all triangles, and is
/// finished; without the vertices if it does not share them. The same tree gives the same calls for any number of threads.
///
/// Where the sink wants normals, that of a vertex is the direction of the sum of the unit normals of the Hermite edges that
/// the vertex stands for, outward: one a vertex, so at a sharp edge of the part a mean of both sides.
///
/// # Errors
///
/// [`Error::Setting`] if `iso` is not a finite number above 0, if the tolerance is below 0 or no finite number, if the
/// tree contradicts itself or if there are more than 2^32 − 1 shared vertices; [`Error::Interrupted`] when `progress`
/// says so; what reading the tree and writing to the sink give.
pub fn contour(
    tree: &dyn BrickTree,
    options: &ContourOptions,
    sink: &mut dyn MeshSink,
    progress: &dyn Progress,
) -> Result<MeshSummary> {
    let level = level(options.iso)?;
    require_half(tree, options.iso)?;
    require_tolerance(options)?;
    options.temp_dir.as_deref().map_or(Ok(()), require_folder)?;
    let mut field = stages::field(tree, level, options)?;
    require_resolution(tree, options.level)?;
    stages::merge_across(&mut field, sink.wants_normals(), progress)?;
    let mut summary = MeshSummary::default();
    if sink.shares_vertices() {
        let folder = sink.folder().map(|own| options.temp_dir.as_deref().unwrap_or(own));
        let later = TriangleSpool::new(folder, sink.encoding());
        let spare = BufferPool::default();
        let made = vertices(&field, options.method, (&later, &spare), sink, progress, &mut summary)?;
        triangles(&later, &made, &spare, sink, progress)?;
    } else {
        lone_triangles(&field, options.method, sink, progress, &mut summary)?;
    }
    // What a sink does at the end may need the memory of the caches.
    drop(field);
    sink.finish()?;
    Ok(summary)
}

/// Hands all vertices to the sink, and the triangles that it takes between them, and puts the others away.
fn vertices(
    field: &LevelSet,
    method: ContourMethod,
    (later, spare): (&TriangleSpool, &BufferPool<u8>),
    sink: &mut dyn MeshSink,
    progress: &dyn Progress,
    summary: &mut MeshSummary,
) -> Result<Numbering> {
    let mut numbering = Numbering::new(field.leaves.len());
    let takes_triangles = sink.takes_triangles_between();
    progress.phase("contouring", Some(field.leaves.len() as u64), "bricks");
    let encoding = sink.encoding();
    let making = FacetOptions::new(encoding, sink.wants_normals());
    let make = |leaf| {
        let (positions, part, mut facets) = contoured(field, method, leaf, &making)?;
        let mut vertices = Vertices {
            positions,
            on_edges: std::mem::take(&mut facets.edge_vertices),
            normals: std::mem::take(&mut facets.normals),
        };
        let mut bytes = spare.take();
        if let Some(encoding) = encoding {
            for (positions, normals) in vertices.slices() {
                encoding.vertices.append(positions, normals, &mut bytes);
            }
            vertices.normals = Vec::new();
        }
        let kept = later.keep(&mut facets)?;
        making.spare.keep(std::mem::take(&mut facets.bytes));
        Ok((vertices, part, bytes, kept))
    };
    field.in_order(
        progress,
        make,
        |(vertices, part, bytes, kept): (Vertices, MeshSummary, Vec<u8>, SpooledTriangles)| {
            match encoding {
                Some(_) => {
                    sink.encoded(MeshChunk::Vertices(part.vertices as usize, &bytes))?;
                    spare.keep(bytes);
                }
                None if making.normals => vertices
                    .slices()
                    .into_iter()
                    .try_for_each(|(positions, normals)| sink.vertices_with_normals(positions, normals))?,
                None => {
                    vertices.slices().into_iter().try_for_each(|(positions, _)| sink.vertices(positions))?
                }
            }
            summary.add(&part);
            numbering.waiting.push(kept);
            numbering.first_vertex.push(u32::try_from(summary.vertices).map_err(|_| {
                Error::setting(
                    "the mesh has more than 2^32 - 1 vertices",
                    "write .stl, which does not number them, or choose a coarser level with `level`",
                )
            })?);
            while takes_triangles && let Some(next) = numbering.next() {
                let numbered = later.numbered(next, &numbering.first_vertex, spare.take())?;
                hand_over(sink, next.count as usize, numbered, spare)?;
                making.spare.keep(numbering.waiting[numbering.given].room());
                numbering.given += 1;
            }
            if numbering.given < numbering.waiting.len() {
                numbering.waiting.last_mut().into_iter().for_each(SpooledTriangles::shrink);
            }
            Ok(())
        },
    )?;
    Ok(numbering)
}

/// Hands the triangles to the sink that it does not have yet.
fn triangles(
    later: &TriangleSpool,
    made: &Numbering,
    spare: &BufferPool<u8>,
    sink: &mut dyn MeshSink,
    progress: &dyn Progress,
) -> Result<()> {
    let waiting = &made.waiting[made.given..];
    if waiting.is_empty() {
        return Ok(());
    }
    progress.phase("triangles", Some(waiting.len() as u64), "bricks");
    let make = |leaf: u32| {
        let waiting = &waiting[leaf as usize];
        Ok((waiting.count as usize, later.numbered(waiting, &made.first_vertex, spare.take())?))
    };
    in_order(waiting.len(), progress, make, |(count, numbered)| hand_over(sink, count, numbered, spare))
}

/// Hands so many triangles to the sink, and keeps their room.
fn hand_over(
    sink: &mut dyn MeshSink,
    count: usize,
    numbered: NumberedTriangles,
    spare: &BufferPool<u8>,
) -> Result<()> {
    match numbered {
        NumberedTriangles::Bytes(bytes) => {
            sink.encoded(MeshChunk::Triangles(count, &bytes))?;
            spare.keep(bytes);
            Ok(())
        }
        NumberedTriangles::Facets(facets) => sink.triangles(&facets),
    }
}

/// Hands all triangles to a sink that shares no vertices.
fn lone_triangles(
    field: &LevelSet,
    method: ContourMethod,
    sink: &mut dyn MeshSink,
    progress: &dyn Progress,
    summary: &mut MeshSummary,
) -> Result<()> {
    progress.phase("contouring", Some(field.leaves.len() as u64), "bricks");
    let encoding = sink.encoding();
    let making = FacetOptions::new(encoding, false);
    let make = |leaf| contoured(field, method, leaf, &making);
    field.in_order(progress, make, |(_, part, facets)| {
        summary.add(&part);
        match encoding {
            Some(_) => sink.encoded(MeshChunk::Triangles(facets.count, &facets.bytes))?,
            None => sink.triangles(&triangle_names::whole(&facets.bytes))?,
        }
        making.spare.keep(facets.bytes);
        Ok(())
    })
}

/// World positions of the vertices of a leaf, those on edges of polygons aside.
enum Positions {
    Dual(LeafVertices),
    OnEdges(Vec<[f32; 3]>),
}

impl Positions {
    /// Them, in order.
    fn slices(&self) -> [&[[f32; 3]]; 2] {
        match self {
            Positions::Dual(vertices) => [vertices.positions(), vertices.on_faces()],
            Positions::OnEdges(positions) => [positions, &[]],
        }
    }
}

/// The vertices of a leaf, with their normals where these are wanted.
struct Vertices {
    positions: Positions,
    on_edges: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

/// Positions, and normals where these are wanted.
type Both<'a> = (&'a [[f32; 3]], &'a [[f32; 3]]);

impl Vertices {
    /// Both, in order.
    fn slices(&self) -> [Both<'_>; 3] {
        let [of_cells, on_faces] = self.positions.slices();
        let mut rest = &self.normals[..];
        [of_cells, on_faces, &self.on_edges].map(|positions| {
            let (normals, others) = rest.split_at(positions.len().min(rest.len()));
            rest = others;
            (positions, normals)
        })
    }
}

/// The vertices of a leaf, what it adds to a summary, and its triangles. A leaf's polygons need the cells of the leaves
/// below it, which come before it, and of coarser ones.
fn contoured(
    field: &LevelSet,
    method: ContourMethod,
    leaf: u32,
    making: &FacetOptions,
) -> Result<(Positions, MeshSummary, LeafFacets)> {
    let (positions, mut part, facets) = match method {
        ContourMethod::Dual => {
            let vertices = field.vertices(leaf)?;
            field.release_drafts(leaf);
            // Before the polygons, behind which the leaf's surface is dropped.
            let normals = making.normals.then(|| LeafNormals::of(field, leaf, &vertices)).transpose()?;
            let mut facets = polygons::leaf_facets(field, leaf, &vertices, making)?;
            if let Some(normals) = normals {
                facets.normals = normals.with_edges(&facets.fan_edges);
            }
            let part = MeshSummary::of_leaf(&vertices);
            (Positions::Dual(vertices), part, facets)
        }
        ContourMethod::MarchingCubes => {
            let (positions, facets) = marching::leaf_facets(field, leaf, making)?;
            let part = MeshSummary::of_positions(&positions);
            (Positions::OnEdges(positions), part, facets)
        }
    };
    part.add(&MeshSummary::of_edges(&facets.edge_vertices));
    part.add(&MeshSummary {
        triangles: facets.count as u64,
        area: facets.measured.area,
        volume: facets.measured.volume,
        ..MeshSummary::default()
    });
    Ok((positions, part, facets))
}

impl MeshSummary {
    /// What the vertices of a leaf add to a summary.
    fn of_leaf(vertices: &LeafVertices) -> MeshSummary {
        let mut part = MeshSummary {
            split_faces: vertices.split_faces(),
            mixed_cells: vertices.cells.mixed_cells(),
            unseparated_cells: vertices.cells.unseparated,
            ..MeshSummary::of_positions(vertices.positions())
        };
        part.add(&MeshSummary {
            face_vertices: vertices.face_vertices() as u64,
            ..MeshSummary::of_positions(vertices.on_faces())
        });
        part
    }

    /// What vertices on edges add to a summary.
    fn of_edges(positions: &[[f32; 3]]) -> MeshSummary {
        MeshSummary { edge_vertices: positions.len() as u64, ..MeshSummary::of_positions(positions) }
    }

    fn of_positions(positions: &[[f32; 3]]) -> MeshSummary {
        let first = positions.first().copied();
        let bounds =
            first.map(|first| positions.iter().fold([first; 2], |bounds, p| united(bounds, [*p; 2])));
        MeshSummary { vertices: positions.len() as u64, bounds, ..MeshSummary::default() }
    }

    /// Adds what a leaf adds.
    fn add(&mut self, part: &MeshSummary) {
        self.vertices += part.vertices;
        self.triangles += part.triangles;
        self.area += part.area;
        self.volume += part.volume;
        self.split_faces += part.split_faces;
        self.face_vertices += part.face_vertices;
        self.edge_vertices += part.edge_vertices;
        self.mixed_cells += part.mixed_cells;
        self.unseparated_cells += part.unseparated_cells;
        self.bounds = match (self.bounds, part.bounds) {
            (Some(a), Some(b)) => Some(united(a, b)),
            (a, b) => a.or(b),
        };
    }
}
