//! What a build is asked for.

use super::resources::Resources;
use super::thin::ThinDepth;
use crate::brick::Count;
use crate::lattice::RootCube;
use crate::pieces::Consistency;
use crate::solid::Outline;
use crate::store::{Compression, Refine, SettingPairs, ShardId};
use std::time::Duration;

/// How fine the deepest bricks are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// Depth 4 of meshes: 512 cells along the root's edge, seconds for a million facets, and half a millimetre on a quarter
    /// metre. Of beads as solids cells of at most 0.4 of the least height and width. Of point clouds the depth whose cells are nearest to half the points' spacing.
    Auto,
    /// Deepest level: 32·2^level cells along the root's edge.
    Depth(u8),
    /// Edge of the deepest cells in the input's unit; the root cube is grown to fit.
    Cell(f64),
    /// The root cube of another tree and its deepest level, so that samples of both stand at the same places.
    Like(RootCube, u8),
}

/// Settings of [`super::build`].
#[derive(Clone, Debug, PartialEq)]
pub struct BuildOptions {
    /// Depth or cell size.
    pub resolution: Resolution,
    /// Criterion above the depth limit.
    pub refine: Refine,
    /// Largest standard deviation of a leaf above the depth limit.
    pub stddev: f64,
    /// How far, in the input's unit, the boundary may be from the mesh of a leaf above the depth limit; 0 divides all that
    /// facets touch. Of closed meshes only.
    pub tolerance: f64,
    /// Largest error of samples of open input; those of closed input are exact.
    pub gwn_error: f64,
    /// Whether bricks in which walls or gaps hide between samples are divided further than [`BuildOptions::resolution`]
    /// says. Of closed meshes and of beads as solids, with [`Refine::Hidden`] and neither a deviation nor a tolerance.
    pub thin: ThinDepth,
    /// The cross-section of beads as analytic solids, for inputs that are all toolpaths; `None` builds from
    /// triangles, those swept along toolpaths included.
    pub solids: Option<Outline>,
    /// What the samples of beads as solids count.
    pub count: Count,
    /// Turn over pieces that are inside out, of inputs that are built from triangles.
    pub orient: Option<Consistency>,
    /// Record in every leaf which beads it counts, where beads are solids.
    pub identity: bool,
    /// Build only this shard of the tree, to be joined with the others by [`super::merge`].
    pub shard: Option<ShardId>,
    /// How payloads are stored. The store has the bytes that [`brickfield_octree::cache::repack`] makes of one with another.
    pub compression: Compression,
    /// What the build may take.
    pub resources: Resources,
    /// What is kept if it is interrupted.
    pub keeping: CommitOptions,
    /// Length unit of the input, recorded in the store.
    pub unit: String,
    /// Program name and version, recorded in the store.
    pub program: String,
}

impl Default for BuildOptions {
    /// The whole tree to the depth that is chosen where none is asked for, samples of open input within a thousandth,
    /// in millimetres, without bounds.
    fn default() -> Self {
        BuildOptions {
            resolution: Resolution::Auto,
            refine: Refine::Hidden,
            stddev: 0.0,
            tolerance: 0.0,
            gwn_error: 1e-3,
            thin: ThinDepth::None,
            solids: None,
            count: Count::default(),
            orient: None,
            identity: false,
            shard: None,
            compression: Compression::Lz4,
            resources: Resources::default(),
            keeping: CommitOptions::default(),
            unit: "mm".to_owned(),
            program: concat!("brickfield-engine ", env!("CARGO_PKG_VERSION")).to_owned(),
        }
    }
}

/// How a build is kept from being lost: it commits now and then what it has, and the same build goes on from there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CommitOptions {
    /// Time between two commits: what a crash may cost, beside the pass over the input.
    pub pace: Duration,
    /// Give up what an earlier run has left.
    pub restart: bool,
    /// What decides the store beside these options and the inputs' bytes, by name, as how the inputs were read. A run
    /// with other settings does not go on with what this one leaves.
    pub settings: SettingPairs,
}

impl Default for CommitOptions {
    fn default() -> Self {
        CommitOptions { pace: Duration::from_secs(10), restart: false, settings: SettingPairs::new() }
    }
}
