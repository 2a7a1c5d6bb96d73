//! What light makes of surfaces, and what of it a ray gathers.

use super::camera::{Vector, dot, scaled, sum, unit};
use super::style::{IsoSurface, Lighting, Paint};
use crate::picture::{Rgba, Scale};

/// Cut faces of parts in other colours than those of w.
const CAP: [f64; 3] = [205.0; 3];

/// Light, given the picture's axes: to the right, upward, towards the eye.
pub(super) struct Light {
    lighting: Lighting,
    key: Vector,
    fill: Vector,
    towards: Vector,
}

impl Light {
    pub fn new([right, up, towards]: [Vector; 3], lighting: Lighting) -> Light {
        let from = |[x, y, z]: Vector| unit(sum(sum(scaled(right, x), scaled(up, y)), scaled(towards, z)));
        Light { lighting, key: from(lighting.from), fill: from([0.8, -0.1, 0.5]), towards }
    }

    /// The directions of the stronger lamp, of the weaker one, and of the eye.
    pub fn directions(&self) -> [Vector; 3] {
        [self.key, self.fill, self.towards]
    }

    /// From where gloss comes: half way between the stronger lamp and the eye.
    pub fn half(&self) -> Vector {
        unit(sum(self.key, self.towards))
    }

    /// What light there is.
    pub fn lighting(&self) -> Lighting {
        self.lighting
    }

    /// A matt surface with some gloss.
    fn shaded(&self, colour: [f64; 3], normal: Vector) -> [f64; 3] {
        let lit = |from: Vector| dot(normal, from).max(0.0);
        let half = lit(self.half());
        let Lighting { ambient, strength, fill, gloss, .. } = self.lighting;
        let gloss = 255.0 * gloss * half.powi(24);
        let light = ambient + strength * lit(self.key) + fill * lit(self.fill);
        colour.map(|c| c * light + gloss)
    }

    /// Colour and opacity of a surface with an outward normal, `w` being the largest winding number beside it.
    pub fn surface(&self, surface: &IsoSurface, w: f64, normal: Vector) -> ([f64; 3], f64) {
        let colour = match surface.paint {
            Paint::Plain(colour) => colour.map(f64::from),
            // Not quite as in sections, so that gloss shows on the darkest and shade on the palest.
            Paint::Counted => colour_of(Scale::Counted.colour(w)).map(|c| c * 0.95 + 8.0),
        };
        let facing = dot(normal, self.towards);
        // What is transparent is seen from within, too.
        let towards_eye = if facing < 0.0 && !surface.is_opaque() { scaled(normal, -1.0) } else { normal };
        let colour = if surface.shaded { self.shaded(colour, towards_eye) } else { colour };
        let edge = 1.0 - facing.abs().min(1.0);
        (colour, (surface.opacity + surface.rim * edge * edge * edge).min(1.0))
    }

    /// An opaque surface of a colour that something else decides, seen from whichever side.
    pub fn tinted(&self, colour: [u8; 3], normal: Vector) -> [f64; 3] {
        let towards_eye = if dot(normal, self.towards) < 0.0 { scaled(normal, -1.0) } else { normal };
        self.shaded(colour.map(f64::from), towards_eye)
    }

    /// Where a cut opens a part whose surface has colours of its own: grey.
    pub fn plain_cap(&self, normal: Vector) -> [f64; 3] {
        let light = 0.8 + 0.2 * dot(normal, self.towards).abs();
        CAP.map(|c| c * light)
    }

    /// Where a cut opens the part: the colour of w as sections have it, less light on the sides that face away.
    pub fn cap(&self, w: f64, normal: Vector) -> [f64; 3] {
        let light = 0.8 + 0.2 * dot(normal, self.towards).abs();
        colour_of(Scale::Counted.colour(w)).map(|c| c * light)
    }

    /// Part of a haze, darker where w rises across the line of sight; where it does not rise at all nothing faces away.
    pub fn haze(&self, colour: [f64; 3], normal: Vector) -> [f64; 3] {
        if normal == [0.0; 3] {
            return colour;
        }
        let light = 0.55 + 0.45 * dot(normal, self.towards).abs();
        colour.map(|c| c * light)
    }
}

pub(super) fn colour_of([r, g, b, _]: Rgba) -> [f64; 3] {
    [r, g, b].map(f64::from)
}

/// Light that has come along a ray so far, the nearest first.
#[derive(Clone, Copy, Default)]
pub(super) struct RayLight {
    /// Multiplied by the opacity.
    colour: [f64; 3],
    opacity: f64,
}

impl RayLight {
    /// Puts something behind what is there.
    pub fn add(&mut self, colour: [f64; 3], opacity: f64) {
        let share = opacity * (1.0 - self.opacity);
        for (sum, c) in self.colour.iter_mut().zip(colour) {
            *sum += c * share;
        }
        self.opacity += share;
    }

    /// Whether nothing behind would show.
    pub fn is_full(&self) -> bool {
        self.opacity > 0.995
    }

    /// In front of a background.
    pub fn over(mut self, background: Rgba) -> Rgba {
        let opacity = f64::from(background[3]) / 255.0;
        self.add(colour_of(background), opacity);
        if self.opacity <= 0.0 {
            return [0; 4];
        }
        let byte = |c: f64| (c + 0.5).clamp(0.0, 255.0) as u8;
        let [r, g, b] = self.colour.map(|c| byte(c / self.opacity));
        [r, g, b, byte(self.opacity * 255.0)]
    }
}
