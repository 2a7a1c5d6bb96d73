//! The program as its users run it.

mod support;

mod program {
    mod backend;
    mod bad_input;
    mod beads;
    mod build;
    mod cache;
    mod cells;
    mod check;
    mod closing;
    mod clouds;
    mod csg;
    mod detail;
    mod determinism;
    mod deviation_tables;
    mod distance;
    mod documents;
    #[cfg(feature = "http")]
    mod elsewhere;
    mod export;
    mod inputs;
    mod kills;
    mod large_format;
    mod layers;
    mod local_thickness;
    mod machine;
    mod measured_points;
    mod mesh;
    mod mesh_places;
    mod open;
    mod orient;
    mod overlays;
    mod passes;
    mod pictures;
    mod points;
    mod resources;
    mod shards;
    mod shell;
    mod signals;
    mod splat_picks;
    mod splats;
    mod store;
    mod summaries;
    mod thin;
    mod tiles;
    mod toolpaths;
    mod traps;
    mod usage;
    #[cfg(feature = "view")]
    mod view;
    mod void_meshes;
    mod voids;
    mod volume_files;
    mod volume_inputs;
    mod volumes;
}
