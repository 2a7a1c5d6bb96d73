//! What is shown: transfer functions from w to what is seen.

use super::nodes::RayNode;
use super::stops::{Stops, W_MAX};
use crate::error::{Error, Result};

/// Most surfaces of a style.
pub const SURFACES_MAX: usize = 4;

/// Brightest light.
pub const BRIGHTNESS_MAX: f64 = 4.0;

/// A transfer function: surfaces where w passes a number, and a haze where w lies between two numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Style {
    /// Where w passes a number, at most [`SURFACES_MAX`].
    pub surfaces: Vec<IsoSurface>,
    /// What is seen of w itself.
    pub volume: Option<VolumeStyle>,
    /// The light on shaded surfaces.
    pub lighting: Lighting,
}

/// Where w passes a number. One that is opaque encloses something: where a cut opens it, w is shown in the colours of
/// sections.
#[derive(Clone, Debug, PartialEq)]
pub struct IsoSurface {
    /// The number, above 0: what is outside of everything, and of the root cube, has none.
    pub w: f64,
    /// Its colour.
    pub paint: Paint,
    /// 0 to 1 where it is seen from the front.
    pub opacity: f64,
    /// How much more opaque it is where it is seen from its edge.
    pub rim: f64,
    /// Whether light shows its shape.
    pub shaded: bool,
}

/// The colour of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Paint {
    /// That of the largest w beside it, as sections have it.
    Counted,
    /// Always this one, sRGB.
    Plain([u8; 3]),
}

/// A haze. What lies at the first and the last stop of its opacity, or beyond, is not seen.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeStyle {
    /// How much of what is behind a stretch of [`VolumeStyle::stretch`] hides, 0 to 1, by w.
    pub opacity: Stops<1>,
    /// Its colour by w, sRGB from 0 to 255.
    pub colour: Stops<3>,
    /// Whether it is darker where w rises across the line of sight.
    pub shaded: bool,
    /// The length that has this opacity, in world units. `None` for a cell of whichever brick it lies in: so a boundary,
    /// which is one cell wide at every level, is as dense at every level.
    pub stretch: Option<f64>,
}

/// The light on shaded surfaces, which moves with the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lighting {
    /// Where the stronger lamp stands: to the right, upward and towards the eye. Its length means nothing.
    pub from: [f64; 3],
    /// Light from everywhere. This, that of the two lamps, and gloss are from 0 to [`BRIGHTNESS_MAX`]; light of 1 shows a
    /// colour as it is.
    pub ambient: f64,
    /// Of the stronger lamp.
    pub strength: f64,
    /// Of a weaker lamp, from the right.
    pub fill: f64,
    /// Brightest gloss.
    pub gloss: f64,
}

impl Lighting {
    /// Light from all sides, so that colours are those of a legend and shapes still show.
    pub fn even() -> Lighting {
        Lighting { ambient: 0.64, strength: 0.34, fill: 0.12, gloss: 0.04, ..Lighting::default() }
    }
}

impl Default for Lighting {
    fn default() -> Lighting {
        Lighting { from: [-0.55, 0.65, 0.55], ambient: 0.30, strength: 0.62, fill: 0.22, gloss: 0.133 }
    }
}

/// A warm grey, on which shading shows.
const BODY: [u8; 3] = [226, 178, 128];
/// What the boundary of overlaps is seen in.
const GHOST: [u8; 3] = [120, 135, 155];
/// Winding numbers below this are nothing in the style of boundaries: far from an open input they are never 0.
const LEAST_SEEN: f64 = 0.02;
/// Opacity of a cell's length of what is seen in that style.
const OPACITY_A_CELL: f64 = 0.35;
/// From blue to red around the colour circle, for w from 0 to 1, as in Fig. 9 of Peelar et al. 2019.
const RAINBOW: [(f64, [f64; 3]); 6] = [
    (0.0, [40.0, 60.0, 220.0]),
    (0.2, [20.0, 160.0, 230.0]),
    (0.4, [30.0, 190.0, 90.0]),
    (0.6, [240.0, 225.0, 50.0]),
    (0.8, [245.0, 140.0, 30.0]),
    (1.0, [215.0, 30.0, 35.0]),
];

/// Makes a style that is built in.
pub type BuiltIn = fn() -> Style;

impl Style {
    /// The styles that are built in, by their names.
    pub const NAMED: [(&'static str, BuiltIn); 3] =
        [("solid", Style::solid), ("boundary", Style::boundary), ("overlap", Style::overlap)];

    /// The boundary w = 0.5, opaque.
    pub fn solid() -> Style {
        Style { surfaces: vec![IsoSurface::opaque(0.5, Paint::Plain(BODY))], ..Style::empty() }
    }

    /// w between 0 and 1 in the colours of the rainbow, what lies outside and where w ≥ 1 transparent, so that closed
    /// voids show within (Peelar et al. 2019, Fig. 9).
    pub fn boundary() -> Style {
        let opacity = Stops::new(vec![(LEAST_SEEN, [OPACITY_A_CELL]), (1.0, [OPACITY_A_CELL])]);
        let volume = opacity.and_then(|opacity| {
            Ok(VolumeStyle { opacity, colour: Stops::new(RAINBOW.to_vec())?, shaded: true, stretch: None })
        });
        Style { volume: volume.ok(), ..Style::empty() }
    }

    /// Where w ≥ 2, opaque in the colours of sections, within a faint boundary.
    pub fn overlap() -> Style {
        Style {
            surfaces: vec![IsoSurface::ghost(), IsoSurface::opaque(1.5, Paint::Counted)],
            ..Style::empty()
        }
    }

    /// The boundary as a faint haze, for what a [`super::Tint`] shows within.
    pub fn haze() -> Style {
        Style { surfaces: vec![IsoSurface::ghost()], lighting: Lighting::even(), ..Style::empty() }
    }

    /// The boundary, opaque in the colours of a [`super::Tint`].
    pub fn tinted() -> Style {
        Style { lighting: Lighting::even(), ..Style::solid() }
    }

    fn empty() -> Style {
        Style { surfaces: Vec::new(), volume: None, lighting: Lighting::default() }
    }

    /// Whether it can be drawn.
    ///
    /// # Errors
    /// [`Error::Setting`] if there is nothing to be seen, or a number makes no sense.
    pub fn check(&self) -> Result<()> {
        let refused = |what: &str, remedy: String| Err(Error::setting(what, remedy));
        let count = self.surfaces.len();
        if count > SURFACES_MAX || count == 0 && self.volume.is_none() {
            return refused(
                "the style has nothing to show, or too much",
                format!("give it a volume, or 1 to {SURFACES_MAX} surfaces"),
            );
        }
        let share = |value: f64| (0.0..=1.0).contains(&value);
        let sound = |s: &IsoSurface| s.w > 0.0 && s.w <= W_MAX && share(s.opacity) && share(s.rim);
        let hazy = |v: &VolumeStyle| {
            v.opacity.values().all(|[opacity]| share(opacity)) && v.stretch.is_none_or(|length| length > 0.0)
        };
        if !(self.surfaces.iter().all(sound) && self.volume.iter().all(hazy)) {
            let remedy = format!(
                "choose opacities from 0 to 1, w of surfaces above 0 and up to {W_MAX}, and lengths above 0"
            );
            return refused("a number of the style makes no sense", remedy);
        }
        let Lighting { from, ambient, strength, fill, gloss } = self.lighting;
        let bright =
            [ambient, strength, fill, gloss].iter().all(|light| (0.0..=BRIGHTNESS_MAX).contains(light));
        if !(bright && from.iter().all(|c| c.is_finite()) && from != [0.0; 3]) {
            let remedy = format!("choose a direction, and brightness from 0 to {BRIGHTNESS_MAX}");
            return refused("nothing is lit like this", remedy);
        }
        Ok(())
    }

    /// Whether anything of a node may be seen.
    pub(super) fn sees(&self, node: &RayNode) -> bool {
        let (low, high) = (f64::from(node.range.0), f64::from(node.range.1));
        self.surfaces.iter().any(|surface| {
            // Whole parts of fractions are rounded halves up, and so are numbers to hold against them.
            let w = if node.fractions { (surface.w + 0.5).floor() } else { surface.w };
            high >= w && (surface.is_opaque() || low < w || node.fractions && low <= w)
        }) || self.volume.as_ref().is_some_and(|volume| {
            let [from, to] = volume.opacity.range();
            node.fractions || low < to && high > from
        })
    }

    /// Whether whatever passes through what is below a node shows in its own samples, so far as the index can tell.
    pub(super) fn is_told_by(&self, node: &RayNode) -> bool {
        let own = RayNode { range: node.own, ..*node };
        let passes = |node: &RayNode, w: f64| f64::from(node.range.0) < w && f64::from(node.range.1) >= w;
        let tells = |w: f64| passes(&own, w) || !passes(node, w);
        self.surfaces.iter().all(|surface| tells(surface.w))
            && self.volume.iter().flat_map(|volume| volume.opacity.range()).all(tells)
    }

    /// Whether w itself is needed beside the surfaces.
    pub(super) fn counts(&self) -> bool {
        self.surfaces.iter().any(|surface| surface.paint == Paint::Counted)
    }

    /// Whether w shows where a cut opens the part.
    pub(super) fn caps(&self) -> bool {
        self.surfaces.iter().any(IsoSurface::is_opaque)
    }
}

impl IsoSurface {
    /// An opaque surface with light on it.
    pub fn opaque(w: f64, paint: Paint) -> IsoSurface {
        IsoSurface { w, paint, opacity: 1.0, rim: 0.0, shaded: true }
    }

    /// The boundary, faint but for its rim.
    fn ghost() -> IsoSurface {
        IsoSurface { w: 0.5, paint: Paint::Plain(GHOST), opacity: 0.03, rim: 0.30, shaded: false }
    }

    /// Whether nothing is seen behind it.
    pub fn is_opaque(&self) -> bool {
        self.opacity >= 1.0
    }

    /// The least whole winding number within it.
    pub(super) fn least(&self) -> f64 {
        self.w.ceil()
    }
}

impl VolumeStyle {
    /// Least and greatest w that its stops speak of.
    pub(super) fn range(&self) -> [f64; 2] {
        let ([a, b], [c, d]) = (self.opacity.range(), self.colour.range());
        [a.min(c), b.max(d)]
    }

    /// Whether w is seen.
    pub(super) fn sees(&self, w: f64) -> bool {
        let [from, to] = self.opacity.range();
        w > from && w < to
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(own: (i16, i16), range: (i16, i16)) -> RayNode {
        RayNode { children: 1, range, own, fractions: false }
    }

    #[test]
    fn nodes_are_passed_where_nothing_is_seen() {
        let seen = |style: fn() -> Style, range| style().sees(&node(range, range));
        for (range, expected) in [
            ((0, 0), [false, false, false]),
            ((0, 1), [true, true, true]),
            ((1, 1), [true, false, false]),
            ((1, 2), [true, false, true]),
            ((2, 2), [true, false, true]),
            ((-1, 0), [false, false, false]),
        ] {
            assert_eq!(Style::NAMED.map(|(_, style)| seen(style, range)), expected, "{range:?}");
        }
        // Rounded from 0.3 to 0.6: the boundary may pass.
        let fractions = RayNode { fractions: true, ..node((0, 1), (0, 1)) };
        assert!(Style::NAMED.iter().all(|(_, style)| style().sees(&fractions)));
    }

    #[test]
    fn a_node_that_misses_what_is_below_does_not_stand_for_it() {
        let told = |own, range| Style::NAMED.map(|(_, style)| style().is_told_by(&node(own, range)));
        assert_eq!(told((0, 1), (0, 1)), [true; 3]);
        // A wall between the samples, a gap between them, an overlap between them.
        assert_eq!(told((0, 0), (0, 1)), [false; 3]);
        assert_eq!(told((1, 1), (0, 1)), [false; 3]);
        assert_eq!(told((0, 1), (0, 2)), [true, true, false]);
    }

    #[test]
    fn the_built_in_styles_are_sound_and_others_are_refused() {
        for (name, style) in Style::NAMED {
            assert!(style().check().is_ok(), "{name}");
        }
        let surface = IsoSurface::opaque(0.5, Paint::Counted);
        for bad in [
            Style::empty(),
            Style { surfaces: vec![surface.clone(); SURFACES_MAX + 1], ..Style::empty() },
            Style { surfaces: vec![IsoSurface { opacity: 1.5, ..surface.clone() }], ..Style::empty() },
            Style { surfaces: vec![IsoSurface { w: f64::NAN, ..surface.clone() }], ..Style::empty() },
            Style { surfaces: vec![IsoSurface { w: 0.0, ..surface.clone() }], ..Style::empty() },
            Style { surfaces: vec![IsoSurface { w: -0.5, ..surface.clone() }], ..Style::empty() },
            Style { lighting: Lighting { from: [0.0; 3], ..Lighting::default() }, ..Style::solid() },
            Style { lighting: Lighting { ambient: -1.0, ..Lighting::default() }, ..Style::solid() },
        ] {
            assert!(bad.check().is_err(), "{bad:?}");
        }
    }
}
