//! What is shown, and in which colours.

use super::camera::{Vector, dot, scaled, sum, unit};
use super::nodes::Node;
use crate::picture::{Rgba, Scale};

/// A transfer function: what becomes visible.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Style {
    /// The boundary w = 0.5, opaque; where a cut opens the part, w in the colours of sections.
    #[default]
    Solid,
    /// w between 0 and 1 in the colours of the rainbow, what lies outside and where w ≥ 1 transparent, so that closed
    /// voids show within (Peelar et al. 2019, Fig. 9).
    Boundary,
    /// Where w ≥ 2, opaque in the colours of sections, within a faint boundary.
    Overlap,
}

impl Style {
    /// Names.
    pub const NAMED: [(&'static str, Style); 3] =
        [("solid", Style::Solid), ("boundary", Style::Boundary), ("overlap", Style::Overlap)];

    /// Whether anything of a node may be seen.
    pub(super) fn sees(self, node: &Node) -> bool {
        let (low, high) = node.range;
        match self {
            Style::Solid => high >= 1,
            Style::Boundary => node.fractions || low < 1 && high > 0,
            Style::Overlap => high >= 2 || low < 1 && high >= 1,
        }
    }
}

/// What light makes of surfaces, given the picture's axes: to the right, upward, towards the eye.
pub(super) struct Light {
    key: Vector,
    fill: Vector,
    towards: Vector,
}

/// A warm grey, on which shading shows.
const BODY: [f64; 3] = [226.0, 178.0, 128.0];
/// What the boundary of overlaps is seen in.
const GHOST: [f64; 3] = [120.0, 135.0, 155.0];

impl Light {
    pub fn new([right, up, towards]: [Vector; 3]) -> Light {
        let from =
            |x: f64, y: f64, z: f64| unit(sum(sum(scaled(right, x), scaled(up, y)), scaled(towards, z)));
        Light { key: from(-0.55, 0.65, 0.55), fill: from(0.8, -0.1, 0.5), towards }
    }

    /// A matt surface with some gloss.
    fn shaded(&self, colour: [f64; 3], normal: Vector) -> [f64; 3] {
        let lit = |from: Vector| dot(normal, from).max(0.0);
        let half = lit(unit(sum(self.key, self.towards)));
        let gloss = 34.0 * half.powi(24);
        let light = 0.30 + 0.62 * lit(self.key) + 0.22 * lit(self.fill);
        colour.map(|c| c * light + gloss)
    }

    /// The part's surface.
    pub fn body(&self, normal: Vector) -> [f64; 3] {
        self.shaded(BODY, normal)
    }

    /// A surface in the colour of w.
    pub fn counted(&self, w: f64, normal: Vector) -> [f64; 3] {
        self.shaded(colour_of(Scale::Counted.colour(w)).map(|c| c * 0.95 + 8.0), normal)
    }

    /// Where a cut opens the part: the colour of w as sections have it, less light on the sides that face away.
    pub fn cap(&self, w: f64, normal: Vector) -> [f64; 3] {
        let light = 0.8 + 0.2 * dot(normal, self.towards).abs();
        colour_of(Scale::Counted.colour(w)).map(|c| c * light)
    }

    /// A rainbow's colour, darker where the surface is seen from its edge.
    pub fn rainbow(&self, w: f64, normal: Vector) -> [f64; 3] {
        let light = 0.55 + 0.45 * dot(normal, self.towards).abs();
        Scale::rainbow(w).map(|c| f64::from(c) * light)
    }

    /// A faint surface: colour and opacity, more where it is seen from its edge.
    pub fn ghost(&self, normal: Vector) -> ([f64; 3], f64) {
        let edge = 1.0 - dot(normal, self.towards).abs().min(1.0);
        (GHOST, 0.03 + 0.30 * edge * edge * edge)
    }
}

fn colour_of([r, g, b, _]: Rgba) -> [f64; 3] {
    [r, g, b].map(f64::from)
}

/// Light that has come along a ray so far, the nearest first.
#[derive(Clone, Copy, Default)]
pub(super) struct Gathered {
    /// Multiplied by the opacity.
    colour: [f64; 3],
    opacity: f64,
}

impl Gathered {
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
