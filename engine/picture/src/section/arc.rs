//! How the boundary passes a square between two points of it whose normals are known.
//!
//! Where it bends one way it lies in the triangle of the chord and the two tangents. A smooth boundary is taken for
//! the parabola in that triangle, which touches the tangents.
//!
//! One whose normals turn by a lot is taken for an edge of the part, and follows the tangents to the corner in which
//! they meet. Both stay in the square, so that boundaries of different squares never cross.

/// Cosine of the angle of normals beyond which they belong to two sides of an edge, not to one round face: some 40°.
const COS_SHARP: f64 = 0.766;
/// How far the pieces of a polyline may be from the parabola, in edges of the square.
const PIECE_ERROR: f64 = 0.002;
/// Most pieces of a parabola.
const PIECES_MAX: usize = 4;

/// A point of the boundary, in edges of the square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ArcEnd {
    pub at: [f64; 2],
    /// Outward normal, of length 1, in the square's two directions and across them; `None` if it is unknown.
    pub normal: Option<[f64; 3]>,
}

/// The boundary from one end to the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BoundaryArc {
    ends: [ArcEnd; 2],
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Straight,
    /// Along both tangents.
    Corner([f64; 2]),
    /// Along both tangents as far as the square goes, and along its side in between: of an edge of the part that lies in the
    /// next square.
    Clipped([[f64; 2]; 2]),
    /// The parabola with this control point.
    Round([f64; 2]),
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn mix(a: [f64; 2], b: [f64; 2], t: f64) -> [f64; 2] {
    [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t]
}

impl BoundaryArc {
    /// Within the square from `low` to `low` + 1.
    pub fn new(low: [f64; 2], from: ArcEnd, to: ArcEnd) -> BoundaryArc {
        BoundaryArc { ends: [from, to], kind: kind(low, from, to) }
    }

    /// The straight line.
    pub fn straight(from: ArcEnd, to: ArcEnd) -> BoundaryArc {
        BoundaryArc { ends: [from, to], kind: Kind::Straight }
    }

    /// Where the second coordinate is `height`, if it is between those of the ends: the first coordinate, and the normal.
    pub fn at_height(&self, height: f64) -> Option<(f64, Option<[f64; 3]>)> {
        let [from, to] = self.ends;
        let along = |a: [f64; 2], b: [f64; 2]| {
            let part = (height - a[1]) / (b[1] - a[1]);
            (0.0..=1.0).contains(&part).then(|| mix(a, b, part)[0])
        };
        match self.kind {
            Kind::Straight => {
                let part = (height - from.at[1]) / (to.at[1] - from.at[1]);
                let x = along(from.at, to.at)?;
                Some((x, between(from.normal, to.normal, part)))
            }
            Kind::Corner(corner) => match along(from.at, corner) {
                Some(x) => Some((x, from.normal)),
                None => Some((along(corner, to.at)?, to.normal)),
            },
            Kind::Clipped([first, last]) => match (along(from.at, first), along(last, to.at)) {
                (Some(x), _) => Some((x, from.normal)),
                (_, Some(x)) => Some((x, to.normal)),
                _ => Some((along(first, last)?, None)),
            },
            Kind::Round(control) => {
                let t = root([from.at[1], control[1], to.at[1]], height)?;
                let x = mix(mix(from.at, control, t), mix(control, to.at, t), t)[0];
                Some((x, between(from.normal, to.normal, t)))
            }
        }
    }

    /// The corners of a polyline that stands for it, without the ends.
    pub fn corners(&self) -> impl Iterator<Item = [f64; 2]> + use<> {
        let [from, to] = self.ends.map(|end| end.at);
        let (control, last, pieces) = match self.kind {
            Kind::Straight => (from, to, 1),
            Kind::Corner(corner) => (corner, corner, 2),
            Kind::Clipped([first, last]) => (first, last, 3),
            Kind::Round(control) => {
                let rise =
                    dot(minus(control, mix(from, to, 0.5)), minus(control, mix(from, to, 0.5))).sqrt() / 2.0;
                (control, control, ((rise / PIECE_ERROR).sqrt().ceil() as usize).clamp(1, PIECES_MAX))
            }
        };
        let is_round = matches!(self.kind, Kind::Round(_));
        (1..pieces).map(move |n| {
            let t = n as f64 / pieces as f64;
            match is_round {
                true => mix(mix(from, control, t), mix(control, to, t), t),
                false if n == 1 => control,
                false => last,
            }
        })
    }

    /// A bound on the area between it and the boundary that has its ends and normals and bends one way: the triangle of
    /// chord and tangents. Where these do not meet in the square, an estimate from their angles with the chord.
    pub fn area_bound(&self) -> f64 {
        let [from, to] = self.ends;
        let chord = minus(to.at, from.at);
        match self.kind {
            Kind::Corner(point) | Kind::Round(point) => cross(minus(point, from.at), chord).abs() / 2.0,
            Kind::Clipped([first, last]) => {
                let (a, b) = (minus(first, from.at), minus(last, from.at));
                (cross(a, b) + cross(b, chord)).abs() / 2.0
            }
            Kind::Straight => {
                let length = dot(chord, chord).sqrt();
                (length * length * self.steepness() / 8.0).min(0.5)
            }
        }
    }

    /// The same for how far it is off along the first coordinate at a height.
    pub fn width_bound(&self, height: f64) -> f64 {
        const UNKNOWN: f64 = 0.5;
        let [from, to] = self.ends;
        let chord = BoundaryArc::straight(from, to).at_height(height).map(|(x, _)| x);
        match self.kind {
            Kind::Corner(point) | Kind::Round(point) => {
                let tangents = BoundaryArc { ends: self.ends, kind: Kind::Corner(point) }.at_height(height);
                chord.zip(tangents).map_or(UNKNOWN, |(chord, (tangents, _))| (chord - tangents).abs())
            }
            Kind::Clipped(_) => {
                chord.zip(self.at_height(height)).map_or(UNKNOWN, |(chord, (x, _))| (chord - x).abs())
            }
            Kind::Straight => {
                let run = minus(to.at, from.at);
                (dot(run, run).sqrt() * self.steepness() / 8.0).min(UNKNOWN)
            }
        }
    }

    /// Sum of the slopes of both tangents against the chord; that of two right angles where a normal is unknown.
    fn steepness(&self) -> f64 {
        const STEEPEST: f64 = 8.0;
        let [from, to] = self.ends;
        let chord = minus(to.at, from.at);
        let slope = |normal: Option<[f64; 3]>| {
            let Some([x, y, _]) = normal else { return STEEPEST / 2.0 };
            (dot([x, y], chord) / cross([x, y], chord)).abs().min(STEEPEST / 2.0)
        };
        let sum = slope(from.normal) + slope(to.normal);
        if sum.is_nan() { STEEPEST } else { sum }
    }
}

fn kind(low: [f64; 2], from: ArcEnd, to: ArcEnd) -> Kind {
    let (Some(a), Some(b)) = (from.normal, to.normal) else { return Kind::Straight };
    let (in_a, in_b) = ([a[0], a[1]], [b[0], b[1]]);
    let turn = cross(in_a, in_b);
    if turn.abs() <= 1e-6 * (dot(in_a, in_a) * dot(in_b, in_b)).sqrt() {
        return Kind::Straight;
    }
    let (to_a, to_b) = (dot(in_a, from.at), dot(in_b, to.at));
    let meet = [(to_a * in_b[1] - to_b * in_a[1]) / turn, (to_b * in_a[0] - to_a * in_b[0]) / turn];
    // It bends one way if both ends are on the same side of each other's tangent.
    let bends = [dot(in_a, minus(to.at, from.at)), dot(in_b, minus(from.at, to.at))];
    if bends[0] * bends[1] <= 0.0 {
        return Kind::Straight;
    }
    let is_sharp = a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() < COS_SHARP;
    // A little beyond the square is rounding.
    let is_within = (0..2).all(|n| (-1e-9..=1.0 + 1e-9).contains(&(meet[n] - low[n])));
    let within = std::array::from_fn(|n| meet[n].clamp(low[n], low[n] + 1.0));
    match (is_within, is_sharp) {
        (true, true) => Kind::Corner(within),
        (true, false) => Kind::Round(within),
        (false, true) => match (exit(low, from.at, meet), exit(low, to.at, meet)) {
            ((side, first), (other, last)) if side == other => Kind::Clipped([first, last]),
            _ => Kind::Straight,
        },
        (false, false) => Kind::Straight,
    }
}

/// Where the way from a point of a square to one beyond leaves it, and by which side. A little before that, so that what
/// comes near from the next square does not touch.
fn exit(low: [f64; 2], from: [f64; 2], to: [f64; 2]) -> (usize, [f64; 2]) {
    const MARGIN: f64 = 1e-3;
    let mut first = (4, 1.0);
    for n in 0..2 {
        for (side, is_beyond, at) in [
            (2 * n, to[n] < low[n] + MARGIN, low[n] + MARGIN),
            (2 * n + 1, to[n] > low[n] + 1.0 - MARGIN, low[n] + 1.0 - MARGIN),
        ] {
            let part = ((at - from[n]) / (to[n] - from[n])).max(0.0);
            if is_beyond && part < first.1 {
                first = (side, part);
            }
        }
    }
    (first.0, mix(from, to, first.1))
}

/// The normal in between, of length 1.
fn between(a: Option<[f64; 3]>, b: Option<[f64; 3]>, t: f64) -> Option<[f64; 3]> {
    let (a, b) = (a?, b?);
    let sum: [f64; 3] = std::array::from_fn(|n| a[n] + (b[n] - a[n]) * t);
    let length = sum.iter().map(|c| c * c).sum::<f64>().sqrt();
    (length > 1e-6).then(|| sum.map(|c| c / length))
}

/// Where in 0..1 the parabola with these heights of ends and control point has a height.
fn root([from, control, to]: [f64; 3], height: f64) -> Option<f64> {
    let (a, b, c) = (from - 2.0 * control + to, 2.0 * (control - from), from - height);
    let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
    // Without cancellation; either may be 0 / 0.
    let q = -0.5 * (b + root.copysign(b));
    [c / q, q / a].into_iter().find(|t| (-1e-12..=1.0 + 1e-12).contains(t)).map(|t| t.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_circle(radius: f64, degrees: f64) -> ArcEnd {
        let (sin, cos) = degrees.to_radians().sin_cos();
        ArcEnd { at: [radius * cos - (radius - 0.9), radius * sin], normal: Some([cos, sin, 0.0]) }
    }

    /// Of a circle a quarter of a cell's arc away the parabola is off by a thousandth, the chord by a fiftieth.
    #[test]
    fn round_boundaries_are_followed() {
        for radius in [4.0, 10.0, 40.0] {
            let to = 53.0 / radius;
            let arc = BoundaryArc::new([0.0; 2], on_circle(radius, 0.0), on_circle(radius, to));
            for degrees in [0.2, 0.5, 0.7].map(|part| part * to) {
                let expected = on_circle(radius, degrees);
                let (x, normal) = arc.at_height(expected.at[1]).unwrap();
                let chord =
                    BoundaryArc::straight(arc.ends[0], arc.ends[1]).at_height(expected.at[1]).unwrap().0;
                let error = (x - expected.at[0]).abs();
                assert!(
                    error < 0.002 / radius && error * 10.0 < (chord - expected.at[0]).abs(),
                    "{radius}: {error}"
                );
                assert!(error <= arc.width_bound(expected.at[1]));
                let cos: f64 = normal.unwrap().iter().zip(expected.normal.unwrap()).map(|(a, b)| a * b).sum();
                assert!(cos > 0.9999);
            }
            let corners: Vec<[f64; 2]> = arc.corners().collect();
            assert!(!corners.is_empty() && corners.len() < PIECES_MAX);
        }
    }

    /// Two sides of a box meet in its corner, and bounds hold the corner that the chord cuts off.
    #[test]
    fn sharp_boundaries_have_their_corner() {
        let from = ArcEnd { at: [0.7, 0.0], normal: Some([1.0, 0.0, 0.0]) };
        let to = ArcEnd { at: [0.0, 0.4], normal: Some([0.0, 1.0, 0.0]) };
        let arc = BoundaryArc::new([0.0; 2], from, to);
        assert_eq!(arc.corners().collect::<Vec<_>>(), [[0.7, 0.4]]);
        assert_eq!(arc.at_height(0.3), Some((0.7, from.normal)));
        assert!((arc.area_bound() - 0.14).abs() < 1e-12);
        // An edge that is sharper than a right angle and lies beyond: along the tangents to the square's side.
        let (base, slope) = (
            ArcEnd { at: [0.0, 0.3], normal: Some([0.0, -1.0, 0.0]) },
            ArcEnd { at: [0.6, 1.0], normal: Some([0.8, 0.6, 0.0]) },
        );
        let arc = BoundaryArc::new([0.0; 2], base, slope);
        let corners: Vec<[f64; 2]> = arc.corners().collect();
        assert!(
            matches!(arc.kind, Kind::Clipped(_)) && corners.iter().all(|[x, _]| (x - 0.999).abs() < 1e-9)
        );
        let (x, normal) = arc.at_height(0.9).unwrap();
        assert!((x - 0.675).abs() < 1e-9 && normal == slope.normal, "{x}");
        assert!((arc.at_height(0.4).unwrap().0 - 0.999).abs() < 1e-9);
        // Without normals, or with such as meet elsewhere, it is straight, and the bound is large.
        let unknown = BoundaryArc::new([0.0; 2], ArcEnd { normal: None, ..from }, to);
        let beyond = BoundaryArc::new([0.0; 2], ArcEnd { normal: Some([-0.6, -0.8, 0.0]), ..from }, to);
        for arc in [unknown, beyond] {
            assert_eq!((arc.kind, arc.corners().count()), (Kind::Straight, 0));
            assert!(arc.area_bound() > 0.05);
        }
        // A plane is straight, and sure.
        let slope = Some([0.8, 0.6, 0.0]);
        let (from, to) =
            (ArcEnd { at: [0.75, 0.0], normal: slope }, ArcEnd { at: [0.0, 1.0], normal: slope });
        let arc = BoundaryArc::new([0.0; 2], from, to);
        assert!(arc.kind == Kind::Straight && arc.area_bound() < 1e-12 && arc.width_bound(0.5) < 1e-12);
    }
}
