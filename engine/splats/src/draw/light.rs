//! What light makes of a normal.

use crate::page_draw::{COLOUR, FILL, INNER};
use crate::picture::Rgba;
use crate::render::Lighting;

/// The lamps of a view, as `render` has them in its solid style.
pub(super) struct SplatLight {
    ambient: f32,
    strength: f32,
    weak: f32,
    gloss: f32,
    key: [f32; 3],
    fill: [f32; 3],
    half: [f32; 3],
}

#[inline]
pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn unit(a: [f32; 3]) -> [f32; 3] {
    let length = dot(a, a).sqrt();
    if length > 0.0 { a.map(|c| c / length) } else { a }
}

impl SplatLight {
    /// Given the picture's axes: to the right, upward, towards the eye.
    pub fn new(axes: [[f64; 3]; 3]) -> SplatLight {
        let axes = axes.map(|axis| axis.map(|c| c as f32));
        let from = |lamp: [f32; 3]| {
            unit(std::array::from_fn(|a| lamp[0] * axes[0][a] + lamp[1] * axes[1][a] + lamp[2] * axes[2][a]))
        };
        let Lighting { from: lamp, ambient, strength, fill: weak, gloss } = Lighting::default();
        let (key, fill) = (from(lamp.map(|c| c as f32)), from(FILL));
        let half = unit(std::array::from_fn(|a| key[a] + axes[2][a]));
        let [ambient, strength, weak, gloss] = [ambient, strength, weak, gloss].map(|c| c as f32);
        SplatLight { ambient, strength, weak, gloss, key, fill, half }
    }

    /// The colour of a pixel, by the sum of the normals in it and its ray's direction.
    #[inline]
    pub fn pixel(&self, sum: [f32; 3], along: [f32; 3]) -> Rgba {
        let normal = unit(sum);
        let within = dot(normal, along) > 0.0;
        let [r, g, b] = self.colour(if within { normal.map(|c| -c) } else { normal }, within);
        [r, g, b, 255]
    }

    /// The colour of a surface with a normal, which faces the eye or is seen from within.
    pub fn colour(&self, normal: [f32; 3], within: bool) -> [u8; 3] {
        let lit = |from: [f32; 3]| dot(normal, from).max(0.0);
        let light = self.ambient + self.strength * lit(self.key) + self.weak * lit(self.fill);
        // Products have the same bits everywhere.
        let two = lit(self.half) * lit(self.half);
        let eight = two * two * two * two;
        let gloss = if within { 0.0 } else { 255.0 * self.gloss * eight * eight * eight };
        let colour = if within { INNER } else { COLOUR };
        colour.map(|c| (c * light + gloss + 0.5).clamp(0.0, 255.0) as u8)
    }
}
