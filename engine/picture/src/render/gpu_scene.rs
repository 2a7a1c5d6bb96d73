//! What a device is told of a scene and of a frame: places in edges of the root cube from its first sample.

use super::camera::{Screen, Vector, scaled};
use super::frame::Frame;
use super::light::colour_of;
use super::nodes::{Nodes, RayNode};
use super::stops::Stops;
use super::style::{IsoSurface, Paint, Style};
use crate::lattice::{ROOT_BITS, RootCube};
use crate::picture::Scale;
use brickfield_shaders::{
    COLOURS_AT, COUNTED, OPACITIES_AT, OPAQUE, PALETTE_AT, SEEN, SHADED, Shell, Sight, TABLE_ENTRIES, TOLD,
    TreeNode, UNIFORM,
};

/// w in place of that of stops that are not there.
const BEYOND: f32 = 1e30;

/// What does not change from frame to frame.
pub(super) struct SceneWords {
    pub nodes: Vec<TreeNode>,
    pub shells: Vec<Shell>,
    pub tables: Vec<[f32; 4]>,
}

/// The tree as a style sees it.
pub(super) fn scene_words(nodes: &Nodes, style: &Style) -> SceneWords {
    SceneWords {
        nodes: nodes.iter().map(|node| tree_node(node, style)).collect(),
        shells: style.surfaces.iter().map(shell).collect(),
        tables: tables(style),
    }
}

fn tree_node(node: &RayNode, style: &Style) -> TreeNode {
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    let (low, high) = node.own;
    let is_uniform = low == high && !node.fractions;
    let flags = flag(style.sees(node), SEEN) | flag(style.is_told_by(node), TOLD) | flag(is_uniform, UNIFORM);
    TreeNode { children: node.children, flags: flags | u32::from(low as u16) << 16 }
}

fn shell(surface: &IsoSurface) -> Shell {
    let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
    let colour = match surface.paint {
        Paint::Plain(colour) => colour.map(f64::from),
        Paint::Counted => [0.0; 3],
    };
    Shell {
        colour: four(colour),
        w: surface.w as f32,
        least: surface.least() as f32,
        opacity: surface.opacity as f32,
        rim: surface.rim as f32,
        flags: flag(surface.is_opaque(), OPAQUE)
            | flag(surface.paint == Paint::Counted, COUNTED)
            | flag(surface.shaded, SHADED),
        unused: [0; 3],
    }
}

/// Colours of winding numbers, and the stops of a haze.
fn tables(style: &Style) -> Vec<[f32; 4]> {
    let mut tables = vec![[BEYOND, 0.0, 0.0, 0.0]; TABLE_ENTRIES as usize];
    for (entry, w) in tables[PALETTE_AT as usize..].iter_mut().zip(-1..=Scale::COUNTED_LAST) {
        *entry = four(colour_of(Scale::Counted.colour(w.into())));
    }
    if let Some(volume) = &style.volume {
        put(&mut tables[OPACITIES_AT as usize..], &volume.opacity);
        put(&mut tables[COLOURS_AT as usize..], &volume.colour);
    }
    tables
}

fn put<const N: usize>(entries: &mut [[f32; 4]], stops: &Stops<N>) {
    for (entry, (w, values)) in entries.iter_mut().zip(stops.iter()) {
        entry[0] = *w as f32;
        entry[1..].iter_mut().zip(values).for_each(|(entry, value)| *entry = *value as f32);
    }
}

/// A frame, but for the part of it that is drawn.
pub(super) fn sight_of(frame: &Frame<'_>) -> Sight {
    let (scene, light) = (frame.scene, &frame.eye.light);
    let (style, root) = (&scene.bricks.style, scene.bricks.tree.root());
    let Screen { origin, corner, steps, pixel, distance, parallel } = frame.eye.camera.screen();
    let [key, fill, towards] = light.directions();
    let lighting = light.lighting();
    let [low, high] = scene.clip.corners();
    let sides = scene.clip.cut_sides();
    let cuts = sides.as_flattened().iter().enumerate().fold(0, |bits, (n, cut)| bits | u32::from(*cut) << n);
    let [r, g, b, a] = scene.background;
    let shrunk = |v: Vector| scaled(v, 1.0 / root.edge);
    // The direction of parallel rays has a length of 1 there, too.
    let corner = if parallel { corner } else { shrunk(corner) };
    let volume = style.volume.as_ref();
    let [low_w, high_w] = volume.map_or([0.0; 2], |volume| volume.range());
    let [seen_from, seen_to] = volume.map_or([0.0; 2], |volume| volume.opacity.range());
    let count = |stops: usize| stops as u32;
    Sight {
        origin: four(place(root, origin)),
        corner: four(corner),
        across: four(shrunk(steps[0])),
        down: four(shrunk(steps[1])),
        towards: four(towards),
        key: four(key),
        fill: four(fill),
        half: four(light.half()),
        low: four(place(root, low)),
        high: four(place(root, high)),
        background: [r.into(), g.into(), b.into(), f32::from(a) / 255.0],
        lighting: [lighting.ambient, lighting.strength, lighting.fill, lighting.gloss].map(|c| c as f32),
        volume: [low_w, high_w, seen_from, seen_to].map(|w| w as f32),
        stretch: volume
            .and_then(|volume| volume.stretch)
            .map_or(0.0, |stretch| ((stretch / root.edge) as f32).max(f32::MIN_POSITIVE)),
        pixel: (pixel / root.edge) as f32,
        distance: (distance / root.edge) as f32,
        cell_pixels: frame.cell_pixels as f32,
        parallel: parallel.into(),
        cuts,
        width: scene.size[0],
        height: scene.size[1],
        rays: frame.supersample,
        haze: volume.map_or(0, |volume| if volume.shaded { 1 | SHADED } else { 1 }),
        opacities: volume.map_or(0, |volume| count(volume.opacity.iter().count())),
        colours: volume.map_or(0, |volume| count(volume.colour.iter().count())),
        ..Sight::default()
    }
}

/// A place in the world, in edges of the root cube from its first sample.
fn place(root: RootCube, world: Vector) -> Vector {
    root.to_units(world).map(|c| (c - 1.0) / f64::from(1u32 << ROOT_BITS))
}

fn four([x, y, z]: Vector) -> [f32; 4] {
    [x as f32, y as f32, z as f32, 0.0]
}
