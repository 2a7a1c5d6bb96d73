//! Every number in the tree against oracles that share no code with the engine.
//!
//! The sampled winding numbers are held against `judge::crossing_number` (a ray count in 128-bit integers) and
//! `judge::solid_angle_sum` (floating point, another formula altogether); the Hermite edges against a count of
//! all crossings of their lattice edge, written for these tests.

#[path = "exactness/beads.rs"]
mod beads;
#[path = "exactness/cache.rs"]
mod cache;
#[path = "exactness/cloud_bricks.rs"]
mod cloud_bricks;
#[path = "exactness/files.rs"]
mod files;
#[path = "exactness/hermite.rs"]
mod hermite;
#[path = "exactness/limits.rs"]
mod limits;
#[path = "exactness/mixed_bricks.rs"]
mod mixed_bricks;
#[path = "exactness/open.rs"]
mod open;
#[path = "exactness/open_bricks.rs"]
mod open_bricks;
#[path = "exactness/oracle.rs"]
mod oracle;
#[path = "exactness/passes.rs"]
mod passes;
#[path = "exactness/picks.rs"]
mod picks;
#[path = "exactness/piles.rs"]
mod piles;
#[path = "exactness/points.rs"]
mod points;
#[path = "exactness/refine.rs"]
mod refine;
#[path = "exactness/resources.rs"]
mod resources;
#[path = "exactness/scene.rs"]
mod scene;
#[path = "exactness/shards.rs"]
mod shards;
#[path = "exactness/thin.rs"]
mod thin;
#[path = "exactness/tree.rs"]
mod tree;
