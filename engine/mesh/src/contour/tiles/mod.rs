//! 3D Tiles 1.1 (OGC 22-025r4): a mesh of every level of the octree, cut into one file a node, with implicit tiling.
//!
//! A node is a tile; its eight children replace it. A triangle belongs to the node that its middle lies in, so meshes of
//! neighbours of one level have the same vertices along their border. Coordinates are metres from the middle of the root cube,
//! whose place a matrix of the tileset has.
//!
//! | file | owns |
//! |---|---|
//! | `level` | the mesh of a level, sorted by node |
//! | `tile` | the file of a node |
//! | `tileset` | which nodes have a file, and the file that says where all others are |

mod level;
mod tile;
mod tileset;

use super::{ContourOptions, contour};
use crate::error::{Error, Result};
use crate::lattice::NodeKey;
use crate::part::PartFile;
use crate::part::folder::PartFolder;
use crate::progress::Progress;
use crate::store::{BrickTree, MovedTree};
use level::LevelMesh;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::Path;
use tileset::{CONTENT, SUBTREES, TileGrid};

/// Tiles that are made at once.
const TOGETHER: usize = 256;
/// The file that programs open.
const TILESET: &str = "tileset.json";

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TilesSummary {
    /// Files with meshes.
    pub tiles: u64,
    /// Triangles of the finest level alone, and of all tiles.
    pub finest: u64,
    /// Triangles of all tiles.
    pub triangles: u64,
    /// Levels that have tiles.
    pub levels: u8,
    /// Bytes of all files.
    pub bytes: u64,
}

/// Writes a folder of tiles. It gets its name when it is complete; an older folder of tiles is replaced. `metres` is the length of
/// the unit. The mesh of one level at a time is in memory, about 60 bytes a triangle.
///
/// # Errors
/// If the folder holds anything else; what contouring and writing give.
pub fn write_tiles(
    tree: &dyn BrickTree,
    options: &ContourOptions,
    metres: f64,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<TilesSummary> {
    let middle = MovedTree::middle(tree);
    let moved = MovedTree::new(tree, middle);
    let grid = TileGrid::new(moved.root(), middle, metres);
    let mut out =
        PartFolder::create(folder, |name| [CONTENT, SUBTREES, TILESET].iter().any(|own| name == *own))?;
    let (mut summary, mut contents) = (TilesSummary::default(), BTreeSet::new());
    let deepest = tree.deepest_level().min(options.level.unwrap_or(u8::MAX));
    for level in 0..=deepest {
        let mut mesh = LevelMesh::new(&grid, level);
        contour(&moved, &ContourOptions { level: Some(level), ..options.clone() }, &mut mesh, progress)?;
        let nodes = mesh.nodes(&moved);
        summary.finest = 0;
        for some in nodes.chunks(TOGETHER) {
            progress.check()?;
            let made: Vec<_> =
                some.par_iter().map(|(key, facets)| (*key, mesh.tile(facets, metres))).collect();
            for (key, bytes) in made {
                summary.bytes += write(&out.path().join(content_of(key)), &bytes)?;
                contents.insert(key);
            }
            summary.finest += some.iter().map(|(_, facets)| facets.len() as u64).sum::<u64>();
        }
        if !nodes.is_empty() {
            (summary.tiles, summary.levels) = (summary.tiles + nodes.len() as u64, level + 1);
        }
        summary.triangles += summary.finest;
    }
    for (key, bytes) in grid.subtrees(&contents) {
        summary.bytes += write(&out.path().join(place_of(SUBTREES, key, "subtree")), &bytes)?;
    }
    summary.bytes += write(&out.path().join(TILESET), grid.tileset(&contents).as_bytes())?;
    out.finish()?;
    Ok(summary)
}

fn content_of(key: NodeKey) -> String {
    place_of(CONTENT, key, "glb")
}

fn place_of(folder: &str, key: NodeKey, ending: &str) -> String {
    let [x, y, z] = key.position();
    format!("{folder}/{}/{x}/{y}/{z}.{ending}", key.level())
}

fn write(path: &Path, bytes: &[u8]) -> Result<u64> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(Error::io(folder, "create"))?;
    }
    let mut file = PartFile::create(path)?;
    file.append(bytes)?;
    file.finish()?;
    Ok(bytes.len() as u64)
}
