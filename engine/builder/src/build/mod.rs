//! From triangles to the octree: snap, check that the soup is closed, sort by subtree, build the subtrees on
//! all threads, record them in order.

mod assemble;
mod bins;
mod branches;
mod choose;
mod clock;
mod closed;
mod cloud;
mod cloud_inputs;
mod corners;
mod cost;
mod decide;
mod facet_filter;
#[cfg(test)]
mod faults;
mod field;
mod fit;
mod forecast;
mod identity;
mod in_memory;
mod jobs;
mod listed;
mod measure;
mod memory;
mod merge;
mod mesh_inputs;
mod meshes;
mod mixed;
mod mixed_field;
mod open;
mod options;
mod packing;
mod partition;
mod pipeline;
mod place;
mod plan_file;
mod planned;
mod rebuild;
mod resources;
mod rules;
mod scope;
mod snap;
mod solids;
mod sorted;
mod sorter;
mod soup;
mod spill;
mod subtree;
mod summary;
mod task;
#[cfg(test)]
mod tests;
mod thin;
mod toolpaths;

pub use closed::is_closed;
pub use cloud::{build_clouds, cloud_cells};
pub use cloud_inputs::{BYTES_A_POINT, surfels};
pub use in_memory::{TreeInMemory, build_clouds_in_memory, build_inputs_in_memory, build_mixed_in_memory};
pub use listed::listed_beads;
pub use measure::{Measures, measure};
pub use memory::{
    build_beads_in_memory, build_cloud_and_soup_in_memory, build_cloud_in_memory, build_in_memory,
    build_open_in_memory,
};
pub use merge::{MergeSummary, merge};
pub use meshes::{build, build_opened};
pub use mixed::{MixedInput, build_mixed};
pub use options::{BuildOptions, CommitOptions, Resolution};
pub use plan_file::is_plan;
pub use planned::{PlanSummary, build_planned, plan};
pub use resources::Resources;
pub use rules::TreeOptions;
pub use summary::{
    BeadsSummary, BuildSummary, FacetsSummary, InputSummary, PointsSummary, ResumedBuild, ShardSummary,
};
pub use thin::{ThinDepth, ThinSheetsSummary, ThinSummary};
pub use toolpaths::{BeadSource, bead_sources, bounds_of_sources, build_beads};
