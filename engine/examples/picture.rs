//! A picture of one's own style: the part as a ghost, and where beads overlap in colours, cut open.
//!
//!     cargo run --release -p brickfield-engine --example picture -- part.brf

use brickfield_engine::render::{CutPlane, RenderOptions, Scene, Style, View, write_frame};
use brickfield_engine::{Axis, Error, Octree, Result, Silent};
use std::path::Path;

fn main() -> Result<()> {
    let octree = Octree::open(std::env::args().nth(1).unwrap_or_else(|| "clover.brf".to_owned()))?;
    let (low, high) = octree.bounds();
    let view = View::named("iso").ok_or_else(|| Error::setting("there is no such view", "choose another"))?;
    let options = RenderOptions {
        style: Style::overlap(),
        cuts: vec![CutPlane { axis: Axis::X, at: (low[0] + high[0]) / 2.0, above: true }],
        size: [800, 600],
        ..RenderOptions::of([low, high], View { opening: 30.0, ..view })
    };
    let scene = Scene::new(octree.tree(), &options)?;
    scene.frames().try_for_each(|frame| write_frame(&frame, None, Path::new("overlap.png"), &Silent))
}
