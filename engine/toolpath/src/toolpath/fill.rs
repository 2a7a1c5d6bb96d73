//! Layers that have much less or much more material than room.
//!
//! The volume of beads agrees with what was fed whenever their width came from E, so it says nothing about the part.
//! What does is the room: lines of a raster have their distance for a width, and a layer with an outline has its area.
//!
//! Lines are found by feature and layer ([`mod@raster`]); a layer's area is that of its closed outer perimeters and
//! half a width around them ([`mod@outline`]).
//!
//! Sparse infill is meant to be so, and slicers name it. A feature of such a name is told of only where the lines of
//! most layers lie close and those of a few do not.
//!
//! Where nothing has a name, only layers of one raster and little else are judged. What lies between is silent: a
//! warning that is none makes the next one unread.

mod outline;
mod raster;

use super::gcode::UNNAMED;
use super::{BeadView, Section, UP};
use outline::OutlineLoops;
use raster::{Raster, RasterLine};
use serde::Serialize;
use std::collections::BTreeMap;

/// Parts of its width by which lines may lie farther apart than they are wide.
const APART: f64 = 1.15;
/// Times that the section of a line may have the area of its room.
const FULL: f64 = 1.3;
/// Layers with rasters from which a feature shows how it is meant.
const LAYERS_LEAST: usize = 3;
/// Part of a layer without names that its raster makes up, if the layer is judged.
const RASTER_SHARE: f64 = 0.8;

/// A layer with too little or too much material for its room.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LayerFill {
    /// The layer, from 1.
    pub layer: u32,
    /// Name of the feature whose lines show it.
    pub feature: String,
    /// First and last line of the file that deposit the layer, skirts and supports aside.
    pub lines: (u64, u64),
    /// Width of the lines, mm.
    pub width: f64,
    /// Median distance of neighbouring lines, mm.
    pub pitch: f64,
    /// Material deposited in the layer, skirts and supports aside, mm³.
    pub fed: f64,
    /// Volume within the layer's outline, mm³, if all of its outer perimeters are closed.
    pub room: Option<f64>,
    /// Part of the room that is empty, that of the lines where the layer has no outline; negative if there is more material
    /// than room.
    pub empty: f64,
}

/// What a feature is for, by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    /// Not of the part, or in no raster on purpose.
    Aside,
    /// Outer perimeters.
    Outline,
    /// Other perimeters, and bridges, of which the lines do not tell anything.
    Other,
    /// Dense everywhere.
    Solid,
    /// Dense or not.
    Infill,
    /// Nothing has a name.
    Unknown,
}

impl Purpose {
    fn of(name: &str) -> Purpose {
        let name = name.to_lowercase();
        let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
        if name == UNNAMED {
            Purpose::Unknown
        } else if has(&[
            "skirt", "brim", "support", "raft", "prime", "wipe", "tower", "purge", "custom", "ironing", "gap",
        ]) {
            Purpose::Aside
        } else if has(&["perimeter", "wall", "shell", "contour"]) {
            let is_outer = has(&["external", "outer"]) && !has(&["overhang"]);
            if is_outer { Purpose::Outline } else { Purpose::Other }
        } else if has(&["bridge"]) {
            Purpose::Other
        } else if has(&["solid", "skin", "surface", "top", "bottom"]) {
            Purpose::Solid
        } else {
            Purpose::Infill
        }
    }
}

/// What a feature has in a layer.
#[derive(Default)]
struct Part {
    lines: (u64, u64),
    /// Length and volume of its beads, mm and mm³.
    length: f64,
    fed: f64,
    /// Of the layer that grows.
    straight: Vec<RasterLine>,
    loops: OutlineLoops,
    raster: Option<Raster>,
    /// Area within closed beads and half a width around, mm², if all beads are closed, and the height of the highest.
    area: Option<f64>,
    height: f64,
}

/// Gathers what layers have, bead by bead. Memory grows with the number of layers, not with their beads.
#[derive(Default)]
pub struct LayerFills {
    layer: u32,
    parts: BTreeMap<u16, Part>,
    layers: Vec<(u32, BTreeMap<u16, Part>)>,
}

impl LayerFills {
    /// Takes the next bead of the file.
    pub fn push(&mut self, bead: &BeadView<'_>) {
        let attributes = bead.attributes;
        if attributes.layer != self.layer {
            self.end_layer();
            self.layer = attributes.layer;
        }
        let part = self.parts.entry(attributes.feature).or_default();
        let lines = if part.length > 0.0 { part.lines } else { attributes.lines };
        part.lines = (lines.0.min(attributes.lines.0), lines.1.max(attributes.lines.1));
        let is_upright = bead.axes.iter().all(|axis| *axis == UP);
        let is_closed = is_upright && part.loops.push(bead.points, bead.sections[0].width);
        let mut volume = 0.0;
        for (pair, section) in bead.points.windows(2).zip(bead.sections) {
            let Section { width, height } = *section;
            let line = RasterLine::new(pair[0], pair[1], *section);
            part.length += line.length;
            part.height = part.height.max(height);
            volume += line.length * section.stadium_area();
            if is_upright && !is_closed && pair[0][2] == pair[1][2] && line.length >= 3.0 * width {
                part.straight.push(line);
            }
        }
        part.fed += attributes.fed.unwrap_or(volume);
    }

    fn end_layer(&mut self) {
        let mut parts = std::mem::take(&mut self.parts);
        for part in parts.values_mut() {
            part.raster = raster::of(std::mem::take(&mut part.straight));
            part.area = std::mem::take(&mut part.loops).area();
        }
        if !parts.is_empty() {
            self.layers.push((self.layer, parts));
        }
    }

    /// The layers that a user should know of. `names` are those of the features.
    pub fn finish(mut self, names: &[String]) -> Vec<LayerFill> {
        self.end_layer();
        let purpose =
            |feature: &u16| names.get(usize::from(*feature)).map_or(Purpose::Unknown, |n| Purpose::of(n));
        let mut apart: BTreeMap<u16, Vec<f64>> = BTreeMap::new();
        for (feature, part) in self.layers.iter().flat_map(|(_, parts)| parts) {
            if let Some(raster) = &part.raster {
                apart.entry(*feature).or_default().push(raster.pitch / raster.width);
            }
        }
        let is_dense = |feature: &u16| {
            let ratios = apart.get(feature).map_or(&[][..], Vec::as_slice);
            ratios.len() >= LAYERS_LEAST && raster::median(ratios.to_vec()) <= APART
        };
        let mut found = Vec::new();
        for (layer, parts) in &self.layers {
            let all: f64 = parts.values().map(|part| part.length).sum();
            let judged = parts.iter().find_map(|(feature, part)| {
                let raster = part.raster.as_ref()?;
                let is_judged = match purpose(feature) {
                    Purpose::Solid => true,
                    Purpose::Infill => is_dense(feature),
                    Purpose::Unknown => raster.length >= RASTER_SHARE * all,
                    Purpose::Aside | Purpose::Outline | Purpose::Other => false,
                };
                let is_wrong = raster.pitch > APART * raster.width || raster.fill() > FULL;
                (is_judged && is_wrong).then_some((feature, raster))
            });
            let Some((feature, raster)) = judged else { continue };
            let feature = names.get(usize::from(*feature)).map_or(UNNAMED, String::as_str);
            found.push(fill_of(*layer, parts, &purpose, feature, raster));
        }
        found
    }
}

/// A layer whose raster shows that it is too empty or too full.
fn fill_of(
    layer: u32,
    parts: &BTreeMap<u16, Part>,
    purpose: &impl Fn(&u16) -> Purpose,
    feature: &str,
    raster: &Raster,
) -> LayerFill {
    let of_part: Vec<(Purpose, &Part)> = parts
        .iter()
        .map(|(feature, part)| (purpose(feature), part))
        .filter(|(purpose, _)| *purpose != Purpose::Aside)
        .collect();
    let fed: f64 = of_part.iter().map(|(_, part)| part.fed).sum();
    let outlines = of_part.iter().filter(|(purpose, _)| *purpose == Purpose::Outline);
    let areas: Vec<Option<f64>> = outlines.map(|(_, part)| part.area).collect();
    // An outline that overhangs changes its name on the way round, and then is not closed under either.
    let area = areas.iter().copied().sum::<Option<f64>>().filter(|area| *area > 0.0);
    let height = of_part.iter().map(|(_, part)| part.height).fold(0.0, f64::max);
    let room = area.map(|area| area * height);
    let lines = of_part.iter().map(|(_, part)| part.lines);
    let lines = lines.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or_default();
    LayerFill {
        layer: layer.saturating_add(1),
        feature: feature.to_owned(),
        lines,
        width: raster.width,
        pitch: raster.pitch,
        fed,
        room,
        empty: 1.0 - room.map_or(raster.fill(), |room| fed / room),
    }
}

#[cfg(test)]
mod tests;
