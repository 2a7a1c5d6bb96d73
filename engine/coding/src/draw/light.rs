//! What light makes of a normal: the lamps of the program's pictures.

use super::view::{dot, DrawStyle, DrawView};

const KEY: [f32; 3] = [-0.55, 0.65, 0.55];
/// Where the weaker lamp stands, along the axes of the picture.
pub const FILL: [f32; 3] = [0.8, -0.1, 0.5];
const AMBIENT: f32 = 0.3;
const STRENGTH: f32 = 0.62;
const WEAK: f32 = 0.22;
const GLOSS: f32 = 0.133;
/// Of what is seen from outside.
pub const COLOUR: [f32; 3] = [158.0, 168.0, 182.0];
/// Of what is seen from within.
pub const INNER: [f32; 3] = [206.0, 148.0, 96.0];
/// Of the root's level and of the deepest.
const COARSE: [f32; 3] = [220.0, 120.0, 70.0];
const FINE: [f32; 3] = [70.0, 130.0, 200.0];

fn unit(a: [f32; 3]) -> [f32; 3] {
    let length = dot(a, a).sqrt();
    if length > 0.0 {
        a.map(|c| c / length)
    } else {
        a
    }
}

/// Lamps that turn with the eye.
pub(super) struct Lamps {
    key: [f32; 3],
    fill: [f32; 3],
    half: [f32; 3],
    style: DrawStyle,
    deepest: f32,
}

impl Lamps {
    pub fn new(view: &DrawView) -> Lamps {
        let axes = view.axes.map(|axis| axis.map(|c| c as f32));
        let from = |lamp: [f32; 3]| {
            let mut along = [0.0; 3];
            (0..3).for_each(|a| along[a] = (0..3).map(|n| lamp[n] * axes[n][a]).sum());
            unit(along)
        };
        let (key, fill) = (from(KEY), from(FILL));
        let mut half = axes[2];
        (0..3).for_each(|a| half[a] += key[a]);
        Lamps { key, fill, half: unit(half), style: view.style, deepest: view.deepest.max(1) as f32 }
    }

    /// The colour of a pixel: of the sum of its normals by weight, of their levels by weight, and its ray's direction.
    #[inline]
    pub fn pixel(&self, sum: [f32; 3], levels: f32, along: [f32; 3]) -> [u8; 4] {
        let length = dot(sum, sum).sqrt();
        let mut normal = sum.map(|c| c / length.max(1e-30));
        let is_within = dot(normal, along) > 0.0;
        if is_within {
            normal = normal.map(|c| -c);
        }
        if self.style == DrawStyle::Normals {
            return rgba(normal.map(|c| 255.0 * (c * 0.5 + 0.5)));
        }
        let mut base = if is_within { INNER } else { COLOUR };
        if self.style == DrawStyle::Levels {
            let share = (levels / length.max(1e-6) / self.deepest).clamp(0.0, 1.0);
            (0..3).for_each(|a| base[a] = COARSE[a] + (FINE[a] - COARSE[a]) * share);
        }
        let lit = |from: [f32; 3]| dot(normal, from).max(0.0);
        let light = AMBIENT + STRENGTH * lit(self.key) + WEAK * lit(self.fill);
        let two = lit(self.half) * lit(self.half);
        let eight = two * two * two * two;
        let gloss = if is_within { 0.0 } else { 255.0 * GLOSS * eight * eight * eight };
        rgba(base.map(|c| c * light + gloss))
    }
}

fn rgba(colour: [f32; 3]) -> [u8; 4] {
    let [r, g, b] = colour.map(|c| (c + 0.5).clamp(0.0, 255.0) as u8);
    [r, g, b, 255]
}
