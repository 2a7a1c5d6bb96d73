//! What a part is compared with: a mesh, another store, or a cloud of measured points.

use super::{of_file, of_store, open_inputs, open_store, require_whole_samples, unit_of};
use crate::args::IoArg;
use crate::clouds::open_clouds;
use crate::distance_args::AlignArg;
use crate::elsewhere::is_address;
use crate::failure::Failure;
use crate::output::{in_line, warn};
use crate::progress::Bars;
use anyhow::anyhow;
use brickfield_engine::distance::deviation::{Motion, Reference};
use brickfield_engine::distance::{CloudSurface, MeasuredPart, Sides, Surface, Triangles};
use brickfield_engine::ingest::{CloudInput, Facets, OpenOptions};
use brickfield_engine::large_array::ArrayRoom;
use brickfield_engine::lattice::length;
use brickfield_engine::store::{AcceptedStores, Store, is_store};
use std::path::Path;

/// Ratios of sizes that come of other units, with what they are called.
const RATIOS: [(f64, &str); 3] = [
    (25.4, "as of inches and millimetres"),
    (1000.0, "as of metres and millimetres"),
    (10.0, "as of centimetres and millimetres"),
];

/// Points seldom show all of a part, so their box is no exact multiple of it; but no scan shows so small a part of one.
const CLOUD_RATIO: f64 = 1000.0;

/// What a part is compared with, opened.
pub(super) enum OpenReference {
    Mesh(Box<Triangles>),
    Store(Box<(Surface, Store)>),
    Cloud(Box<CloudSurface>),
}

impl OpenReference {
    /// What it is, in a word.
    pub fn kind(&self) -> &'static str {
        match self {
            OpenReference::Mesh(_) => "mesh",
            OpenReference::Store(_) => "store",
            OpenReference::Cloud(_) => "cloud",
        }
    }

    /// All points, if it is a cloud.
    pub fn points(&self) -> Option<&[[f64; 3]]> {
        match self {
            OpenReference::Cloud(cloud) => Some(cloud.points()),
            OpenReference::Mesh(_) | OpenReference::Store(_) => None,
        }
    }

    /// Where it is inside, if it is a store.
    pub fn sides(&self) -> Result<Option<Sides<'_>>, Failure> {
        match self {
            OpenReference::Mesh(_) | OpenReference::Cloud(_) => Ok(None),
            OpenReference::Store(opened) => Ok(Some(Sides::new(&opened.1)?)),
        }
    }

    /// What distances are told from, with what [`OpenReference::sides`] gives. A cloud needs the part, its samples, and what takes
    /// it to the cloud.
    pub fn reference<'a>(
        &'a self,
        sides: Option<&'a Sides<'a>>,
        (part, sides_of_part): (&'a Surface, &'a Sides<'a>),
        motion: Motion,
    ) -> Reference<'a> {
        match (self, sides) {
            (OpenReference::Mesh(triangles), _) => Reference::Mesh(triangles),
            (OpenReference::Store(opened), Some(sides)) => Reference::Store(&opened.0, sides),
            (OpenReference::Store(_), None) => unreachable!("a store has sides"),
            (OpenReference::Cloud(cloud), _) => {
                Reference::Cloud(MeasuredPart { cloud, part, sides: sides_of_part, motion })
            }
        }
    }
}

/// What a part is compared with, and how, as the user typed it.
pub(super) struct Compared<'a> {
    pub reference: &'a Path,
    /// What is written.
    pub output: &'a Path,
    /// Where temporary files may lie.
    pub folder: &'a Path,
    /// Bytes in all.
    pub memory: u64,
    pub io: IoArg,
    pub align: AlignArg,
}

/// Opens the reference.
pub(super) fn open_reference(
    args: &Compared<'_>,
    part: &Store,
    bars: &Bars,
) -> Result<OpenReference, Failure> {
    let name = in_line(args.reference);
    if is_address(args.reference) || is_store(args.reference) {
        let store = open_store(args.reference, args.memory / 8, args.io, AcceptedStores::Whole)?;
        require_whole_samples(&store, "distances from it cannot be told")?;
        if store.meta().unit != part.meta().unit {
            let (own, other) = (unit_of(store.meta()), unit_of(part.meta()));
            return Err(anyhow!(
                "{name}: it is in {own} and the part in {other}; build one with the other's --unit"
            )
            .into());
        }
        let surface = Surface::new(&store, args.memory / 4, args.folder, bars)
            .map_err(|error| of_store(&store, "surface", error))?;
        if surface.bounds().is_none() {
            return Err(anyhow!("{name}: the store has no surface; build it with finer cells").into());
        }
        return Ok(OpenReference::Store(Box::new((surface, store))));
    }
    if CloudInput::is_one(args.reference)? {
        let room = ArrayRoom::new(args.memory / 4, args.folder);
        let cloud = CloudInput::join(open_clouds(&[args.reference.to_owned()], &room, bars)?)?;
        let cloud = CloudSurface::new(cloud).map_err(|error| of_file(args.reference, error))?;
        return Ok(OpenReference::Cloud(Box::new(cloud)));
    }
    let inputs = open_inputs(&[args.reference.to_owned()], &[args.output], &OpenOptions::default(), bars)?;
    if inputs.iter().any(|input| input.beads().is_some() || input.sweeps().is_some()) {
        return Err(anyhow!("{name}: it is a toolpath; build a store of it and give that").into());
    }
    let sources: Vec<&dyn Facets> = inputs.iter().map(|input| input as &dyn Facets).collect();
    let triangles = Triangles::new(&sources, (args.memory / 2, args.folder), bars)
        .map_err(|error| of_file(args.reference, error))?;
    inputs.iter().try_for_each(|input| input.check())?;
    if !triangles.is_closed() {
        warn(&format!("{name}: the mesh is not closed, so the nearest triangle tells the side of a point"));
    }
    if triangles.is_inside_out() {
        warn(&format!("{name}: the mesh is inside out, so distances have the wrong sign; turn its facets"));
    }
    Ok(OpenReference::Mesh(Box::new(triangles)))
}

pub(super) fn sizes([low, high]: [[f64; 3]; 2]) -> [f64; 3] {
    std::array::from_fn(|a| high[a] - low[a])
}

/// A box, for people.
fn box_text([low, high]: [[f64; 3]; 2]) -> String {
    format!("{} to {}", point_text(low), point_text(high))
}

/// Three coordinates, for people, without the sign of a 0.
pub(super) fn point_text(p: [f64; 3]) -> String {
    format!("({})", p.map(|c| format!("{:.3}", (c * 1e3).round() / 1e3 + 0.0)).join(", "))
}

/// Refuses a reference in another unit, and one elsewhere that is not to be aligned.
pub(super) fn require_alike(
    args: &Compared<'_>,
    part: [[f64; 3]; 2],
    reference: Reference<'_>,
) -> Result<(), Failure> {
    let name = in_line(args.reference);
    let (own, others) = (sizes(part), sizes(reference.bounds()));
    if let Reference::Cloud(_) = reference {
        let ratio = length(own) / length(others).max(f64::MIN_POSITIVE);
        if (CLOUD_RATIO / 2.0..CLOUD_RATIO * 2.0).contains(&ratio) {
            let what = "it is about 1000 times smaller than the part, as of metres and millimetres";
            return Err(anyhow!("{name}: {what}; scale it, or build the part with --unit").into());
        }
    }
    let reference = reference.bounds();
    for (ratio, units) in RATIOS {
        for (ratio, how) in [(ratio, "larger"), (1.0 / ratio, "smaller")] {
            let is_so = |a: usize| (others[a] / own[a] / ratio - 1.0).abs() < 0.02;
            if (0..3).all(is_so) {
                let times = ratio.max(1.0 / ratio);
                let what = format!("it is {times} times {how} than the part, {units}");
                return Err(
                    anyhow!("{name}: {what}; scale one of them, or build the part with --unit").into()
                );
            }
        }
    }
    let apart = (0..3).any(|a| part[1][a] < reference[0][a] || reference[1][a] < part[0][a]);
    if apart && args.align == AlignArg::None {
        let boxes = format!("the part is at {}, the reference at {}", box_text(part), box_text(reference));
        return Err(anyhow!(
            "{name}: it does not overlap the part; {boxes}; add --align shift to compare shapes"
        )
        .into());
    }
    Ok(())
}
