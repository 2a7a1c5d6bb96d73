//! Bricks as rays want them, kept under a byte budget.

use super::field::{Blocks, FieldScratch, RayField};
use super::style::{IsoSurface, Style};
use crate::brick::{Brick, POINTS, point_index};
use crate::error::Result;
use crate::lattice::NodeKey;
use crate::picture::Scale;
use crate::store::{BrickCache, BrickTree};
use brickfield_shaders::{COUNT_WORDS, FIELD_WORDS, PAGE_HEADER_WORDS};
use std::sync::Arc;

/// Bricks that a thread has at hand without asking the others: a tile's rays pass the same few again and again.
const AT_HAND: usize = 32;

/// What is made of a brick.
pub(super) struct RayBrick {
    /// Of each of the style's surfaces.
    pub surfaces: Vec<SurfaceField>,
    /// For the style's haze; `None` where nobody asks, or nothing of it is seen.
    pub volume: Option<RayField>,
    /// Where any of these is worth a look.
    pub blocks: Blocks,
    /// Where w itself is asked for.
    pub counts: Option<Counts>,
}

/// Whole winding numbers at the samples of a brick, from -1 to the largest that has a colour of its own: half the bytes of
/// samples, and less than half of a brick with its Hermite edges.
pub(super) struct Counts(Box<[i8]>);

impl Counts {
    fn of(brick: &Brick) -> Counts {
        let count = |w: i16| i32::from(w).clamp(-1, Scale::COUNTED_LAST) as i8;
        Counts(match brick {
            Brick::Uniform(w) => vec![count(*w); POINTS].into(),
            Brick::Counts { samples, .. } => samples.0.iter().map(|w| count(samples.whole(*w))).collect(),
        })
    }

    /// The largest at the corners of a cell.
    pub fn most(&self, [i, j, k]: [usize; 3]) -> f64 {
        let corner = |c: usize| self.0[point_index([i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)])];
        (0..8).map(corner).max().unwrap_or(0).into()
    }
}

/// Where a surface passes.
pub(super) struct SurfaceField {
    /// Its distance, or `None` where all samples lie on one side of it.
    pub field: Option<RayField>,
    /// Whether the first sample lies inside, which tells of all where there is no field.
    pub is_inside: bool,
}

impl RayBrick {
    fn new(brick: &Brick, style: &Style, counts: bool, scratch: &mut FieldScratch) -> RayBrick {
        let mut passage = |surface: &IsoSurface| SurfaceField {
            // Hermite edges are those of the boundary.
            field: match surface.w == 0.5 {
                true => RayField::boundary(brick, scratch),
                false => RayField::level(brick, surface.w),
            },
            is_inside: first_sample(brick) >= surface.w,
        };
        let surfaces: Vec<SurfaceField> = style.surfaces.iter().map(&mut passage).collect();
        let volume = match (&style.volume, brick) {
            (Some(volume), Brick::Counts { samples, .. }) => {
                RayField::between(samples, volume.range(), volume.opacity.range())
            }
            _ => None,
        };
        let mut blocks = Blocks::default();
        let fields = surfaces.iter().filter_map(|passage| passage.field.as_ref()).chain(&volume);
        fields.for_each(|field| field.add_blocks(&mut blocks));
        let counts = counts.then(|| Counts::of(brick));
        RayBrick { surfaces, volume, blocks, counts }
    }

    /// Its page: what it has, where anything is worth a look, w itself, and its fields. Returns how many words that are.
    pub fn write(&self, words: &mut [u32]) -> usize {
        let fields = self.surfaces.iter().map(|passage| passage.field.as_ref()).chain([self.volume.as_ref()]);
        let inside = self.surfaces.iter().map(|passage| passage.is_inside);
        let bits = |bits: &mut dyn Iterator<Item = bool>| {
            bits.enumerate().fold(0, |word, (n, bit)| word | u32::from(bit) << n)
        };
        words[0] =
            bits(&mut fields.clone().map(|field| field.is_some())) | bits(&mut inside.into_iter()) << 8;
        words[1..].iter_mut().zip(self.blocks.words()).for_each(|(word, bits)| *word = bits);
        let mut end = PAGE_HEADER_WORDS as usize;
        if let Some(Counts(counts)) = &self.counts {
            let words = &mut words[end..][..COUNT_WORDS as usize];
            bytemuck::cast_slice_mut(words)[..POINTS].copy_from_slice(counts);
            end += COUNT_WORDS as usize;
        }
        for field in fields.flatten() {
            field.write(&mut words[end..]);
            end += FIELD_WORDS as usize;
        }
        end
    }

    /// The most that one takes which has every field, and w itself if `counts`.
    pub fn heap_bytes_max(style: &Style, counts: bool) -> usize {
        let fields = style.surfaces.len() + usize::from(style.volume.is_some());
        fields * RayField::heap_bytes() + if counts { POINTS } else { 0 }
    }

    fn heap_bytes(&self) -> usize {
        let fields = self.surfaces.iter().filter(|passage| passage.field.is_some()).count();
        let fields = fields + usize::from(self.volume.is_some());
        fields * RayField::heap_bytes() + self.counts.as_ref().map_or(0, |counts| counts.0.len())
    }
}

fn first_sample(brick: &Brick) -> f64 {
    match brick {
        Brick::Uniform(w) => f64::from(*w),
        Brick::Counts { samples, .. } => f64::from(samples.0[0]) / f64::from(1u32 << samples.1),
    }
}

/// All bricks of a tree.
pub(super) struct Bricks<'a> {
    pub tree: &'a dyn BrickTree,
    pub style: Style,
    /// Whether bricks are to know w itself.
    pub counts: bool,
    /// Bytes for what is kept.
    pub bytes_max: u64,
    cache: BrickCache<RayBrick>,
}

/// A thread's own bricks, and room to make more.
#[derive(Default)]
pub(super) struct ThreadBricks {
    held: Vec<Option<(NodeKey, Arc<RayBrick>)>>,
    scratch: FieldScratch,
}

impl<'a> Bricks<'a> {
    /// Keeps at most `bytes_max` of what it makes, with w itself if `counts`.
    pub fn new(tree: &'a dyn BrickTree, style: Style, counts: bool, bytes_max: u64) -> Bricks<'a> {
        Bricks { tree, style, counts, bytes_max, cache: BrickCache::new(bytes_max) }
    }

    /// The brick of a node, prepared. Two threads may both prepare one, to the same content.
    pub fn get(&self, key: NodeKey, lane: &mut ThreadBricks) -> Result<Arc<RayBrick>> {
        let [x, y, z] = key.position();
        let slot = (x ^ y << 2 ^ z << 4 ^ x >> 5 ^ y >> 3) as usize % AT_HAND;
        lane.held.resize(AT_HAND, None);
        if let Some((_, prepared)) = lane.held[slot].as_ref().filter(|(held, _)| *held == key) {
            return Ok(Arc::clone(prepared));
        }
        let prepared = match self.cache.get(key) {
            Some(prepared) => prepared,
            None => {
                let brick = self.tree.brick_once(key)?;
                let prepared = Arc::new(RayBrick::new(&brick, &self.style, self.counts, &mut lane.scratch));
                self.cache.insert(key, &prepared, prepared.heap_bytes());
                prepared
            }
        };
        lane.held[slot] = Some((key, Arc::clone(&prepared)));
        Ok(prepared)
    }

    /// Whether a brick is at hand.
    pub fn holds(&self, key: NodeKey) -> bool {
        self.cache.holds(key)
    }

    /// Lets a brick stay for a while.
    pub fn will_be_used(&self, key: NodeKey) {
        self.cache.renew(key);
    }

    /// Lets go of all that is kept.
    pub fn clear(&self) {
        self.cache.clear();
    }

    /// How many were found, and how many had to be made.
    pub fn found_and_made(&self) -> (u64, u64) {
        let stats = self.cache.stats();
        (stats.hits, stats.misses)
    }
}
