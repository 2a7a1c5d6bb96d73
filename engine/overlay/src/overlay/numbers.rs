//! Where the number of each void stands: deep within what a plane shows of it, or where it is seen in space.

use super::VoidTint;
use crate::error::Result;
use crate::picture::Label;
use crate::progress::Progress;
use crate::render::Frame;
use crate::section::{SectionLabel, SectionPicture, section_values};
use crate::store::BrickTree;
use crate::voids::Void;
use std::collections::BTreeMap;

/// Places along the longer side of a section at which voids are looked for.
const PLACES: f64 = 1000.0;

/// The numbers of the voids that a section shows, the largest first, each where it is farthest from what is not that void.
/// Voids narrower than a thousandth of the window may be missed.
///
/// # Errors
/// What reading the tree gives; [`crate::error::Error::Interrupted`].
pub fn numbers_in(
    tree: &dyn BrickTree,
    tint: &VoidTint<'_>,
    what: &SectionPicture,
    progress: &dyn Progress,
) -> Result<Vec<SectionLabel>> {
    let [low, high] = what.window;
    let longer = (high[0] - low[0]).max(high[1] - low[1]);
    let places = SectionPicture { pixel: Some(longer / PLACES), ..what.clone() };
    let section = section_values(tree, &places, progress)?;
    let across = section.size[0];
    let at = |n: usize| [n % across, n / across].map(|steps| steps as f64 * section.step);
    let at = |n: usize| [0, 1].map(|a| section.first[a] + at(n)[a]);
    let mut found = vec![0u32; section.values.len()];
    for (n, number) in found.iter_mut().enumerate().filter(|(n, _)| section.values[*n] < 1.0) {
        *number = tint.number(what.plane.place(at(n)))?;
    }
    let depths = depths(&found, across);
    // The deepest place of each, the first of several.
    let mut best: BTreeMap<u32, (u16, usize)> = BTreeMap::new();
    for (n, &number) in found.iter().enumerate().filter(|(_, number)| **number > 0) {
        let place = best.entry(number).or_insert((0, n));
        if depths[n] > place.0 {
            *place = (depths[n], n);
        }
    }
    let pixel = what.pixel.unwrap_or_else(|| tree.root().spacing(tree.deepest_level()));
    let label = |(number, (depth, n)): (u32, (u16, usize))| {
        let text = number.to_string();
        let half = SectionLabel::size(&text).map(|side| 0.5 * side as f64 * pixel);
        let is_covered = f64::from(depth) * section.step < half[0].max(half[1]);
        // What would be covered has its number to the upper right.
        let beside =
            if is_covered { half.map(|half| half + f64::from(depth) * section.step) } else { [0.0; 2] };
        SectionLabel { at: [0, 1].map(|a| at(n)[a] + beside[a]), text }
    };
    Ok(best.into_iter().map(label).collect())
}

/// Most voids that are numbered in a picture in space.
const NUMBERED: usize = 500;

/// The numbers of the largest voids that are seen at their centroids in a picture in space, the largest first. What is smaller
/// than its number has it to the upper right.
///
/// # Errors
/// What reading the tree gives.
pub fn numbers_seen(frame: &Frame<'_>, tint: &VoidTint<'_>, voids: &[Void], cell: f64) -> Result<Vec<Label>> {
    let places: Vec<(&Void, [f64; 2], f64)> = voids
        .iter()
        .filter(|void| tint.shows(void.id as u32))
        .take(NUMBERED)
        .filter_map(|void| frame.seen_at(void.centroid).map(|(at, pixel)| (void, at, pixel)))
        .collect();
    let rays: Vec<_> = places.iter().map(|(_, at, _)| frame.ray(*at)).collect();
    let mut labels = Vec::new();
    for ((ray, met), (void, at, pixel)) in rays.iter().zip(frame.distances(&rays)?).zip(places) {
        let Some(t) = met else { continue };
        // Just within what is met there.
        let inner = t + 0.5 * cell;
        let within = std::array::from_fn(|a| ray.origin[a] + inner * ray.direction[a]);
        if tint.number(within)? as usize != void.id {
            continue;
        }
        let text = void.id.to_string();
        let half = Label::size(&text).map(|side| 0.5 * side as f64);
        let radius = 0.5 * void.equivalent_diameter() / pixel;
        let beside = if radius < half[0].max(half[1]) { half.map(|half| half + radius) } else { [0.0; 2] };
        labels.push(Label { at: [at[0] + beside[0], at[1] - beside[1]], text });
    }
    Ok(labels)
}

/// Steps across sides and corners from each place to the nearest of another number, or to the border.
fn depths(found: &[u32], across: usize) -> Vec<u16> {
    let up = found.len() / across;
    let mut depths = vec![u16::MAX; found.len()];
    let look = |depths: &mut Vec<u16>, n: usize, others: [(isize, isize); 4]| {
        let (x, y) = ((n % across) as isize, (n / across) as isize);
        for (dx, dy) in others {
            let (ox, oy) = (x + dx, y + dy);
            let is_there = ox >= 0 && oy >= 0 && (ox as usize) < across && (oy as usize) < up;
            let other = if is_there { oy as usize * across + ox as usize } else { n };
            let is_own = is_there && found[other] == found[n];
            let depth = if is_own { depths[other].saturating_add(1) } else { 1 };
            depths[n] = depths[n].min(depth);
        }
    };
    for n in 0..found.len() {
        look(&mut depths, n, [(-1, 0), (-1, -1), (0, -1), (1, -1)]);
    }
    for n in (0..found.len()).rev() {
        look(&mut depths, n, [(1, 0), (1, 1), (0, 1), (-1, 1)]);
    }
    depths
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_are_steps_to_what_is_other() {
        let rows = ["0000000", "0111110", "0111110", "0111110", "0111220", "0111220", "0000000"];
        let found: Vec<u32> = rows.concat().bytes().map(|b| u32::from(b - b'0')).collect();
        let depths = depths(&found, 7);
        for (n, &own) in found.iter().enumerate() {
            let (x, y) = ((n % 7) as i32, (n / 7) as i32);
            let away = |m: usize| ((m % 7) as i32 - x).abs().max(((m / 7) as i32 - y).abs());
            let others = (0..found.len()).filter(|&m| found[m] != own).map(away);
            let nearest = others.chain([x + 1, y + 1, 7 - x, 7 - y]).min().unwrap();
            assert_eq!(i32::from(depths[n]), nearest, "{x} {y}");
        }
    }
}
