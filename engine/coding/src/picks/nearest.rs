//! Which bead passes nearest to a place, and which blocks must be read to know that.

use super::header::PickBlock;
use super::segment::{Beside, PickSegment};
use super::table::{PickTable, PickedBead};

impl PickTable {
    /// The next block that must be read before it is known which bead is nearest to a place, within `reach` of it; the nearest
    /// first. Place and reach are those of the world.
    pub fn wanted(&self, place: [f64; 3], reach: f64) -> Option<usize> {
        let at = self.around_origin(place);
        let known = self.best(at, reach).map_or(reach, |(best, _)| best.distance.max(0.0));
        let away = self.blocks().iter().map(|block| self.away(block, at));
        let missing = away.enumerate().filter(|(n, away)| *away <= known && !self.loaded().contains_key(n));
        let mut first: Option<(usize, f64)> = None;
        for next in missing {
            if first.map_or(true, |first| next.1 < first.1) {
                first = Some(next);
            }
        }
        first.map(|(block, _)| block)
    }

    /// The bead whose solid's surface passes nearest to a place, within `reach` of it, of the blocks that are in memory. Where
    /// beads hold the place, it is the one that it lies deepest in: that one bounds the union. Of equals the first bead counts, and of
    /// its segments the one whose centre line is nearest.
    pub fn nearest(&self, place: [f64; 3], reach: f64) -> Option<PickedBead> {
        let (best, segment) = self.best(self.around_origin(place), reach)?;
        let (low, high) = segment.heights(best.part, self.header().steps);
        let base = self.header().origin[2];
        Some(PickedBead { segment: *segment, distance: best.distance, heights: (base + low, base + high) })
    }

    fn around_origin(&self, place: [f64; 3]) -> [f64; 3] {
        let origin = self.header().origin;
        [0, 1, 2].map(|a| place[a] - origin[a])
    }

    fn best(&self, at: [f64; 3], reach: f64) -> Option<(Beside, &PickSegment)> {
        let (outline, steps) = (self.header().outline, self.header().steps);
        let rank = |(beside, segment): &(Beside, &PickSegment)| {
            (beside.distance, segment.bead.number, beside.across)
        };
        let mut best: Option<(Beside, &PickSegment)> = None;
        for (n, segments) in self.loaded() {
            let most = best.map_or(reach, |(best, _)| best.distance.max(0.0));
            if self.away(&self.blocks()[*n], at) > most {
                continue;
            }
            for segment in segments {
                let next = (segment.beside(at, outline, steps), segment);
                let is_nearer = match &best {
                    Some(best) => rank(&next) < rank(best),
                    None => next.0.distance <= reach,
                };
                if is_nearer {
                    best = Some(next);
                }
            }
        }
        best
    }

    /// Distance of a place from a block's box.
    fn away(&self, block: &PickBlock, at: [f64; 3]) -> f64 {
        let steps = self.header().steps;
        let scale = [steps.across, steps.across, steps.up];
        let beyond = |a: usize| {
            let [low, high] = [block.low[a], block.high[a]].map(|c| f64::from(c) * scale[a]);
            (low - at[a]).max(at[a] - high).max(0.0)
        };
        [0, 1, 2].map(|a| beyond(a) * beyond(a)).iter().sum::<f64>().sqrt()
    }
}
