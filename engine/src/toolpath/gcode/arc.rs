//! Arcs (G2, G3) as chords, with + - * / and the square root alone: the same file gives the same bits on every
//! machine.

/// Most chords of an arc, 2 to this power. A circle of 100 m within 1 µm needs 2^15.
const HALVINGS_MAX: u32 = 20;

/// Where an arc's centre is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Centre {
    /// At this offset from the start, along the plane's two axes (words I, J, K).
    Offset([f64; 2]),
    /// At this distance (word R); of the two arcs the shorter one if positive, the longer one if negative.
    Radius(f64),
}

/// An arc in its plane, seen against the plane's normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arc {
    pub(super) start: [f64; 2],
    pub(super) end: [f64; 2],
    pub(super) centre: Centre,
    pub(super) clockwise: bool,
}

/// Chords of equal angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chords {
    centre: [f64; 2],
    /// From the centre to the start.
    first: [f64; 2],
    /// Cosine and sine of the angle of a chord, counterclockwise.
    turn: [f64; 2],
    /// Length of the end's radius, as a part of the start's.
    growth: f64,
    pub(super) count: u32,
    /// Length of the arc within the plane.
    pub(super) length: f64,
    /// By how much the ends' distances from the centre differ; the radius changes evenly between them.
    pub(super) mismatch: f64,
}

impl Arc {
    /// The chords that deviate from the arc by `tolerance` at most. Start and end alike make a full circle.
    ///
    /// # Errors
    /// If no such arc exists, with the reason.
    pub(super) fn chords(&self, tolerance: f64) -> Result<Chords, &'static str> {
        let offset = match self.centre {
            Centre::Offset(offset) => offset,
            Centre::Radius(radius) => self.offset_by_radius(radius)?,
        };
        let centre = [self.start[0] + offset[0], self.start[1] + offset[1]];
        let first = [-offset[0], -offset[1]];
        let last = [self.end[0] - centre[0], self.end[1] - centre[1]];
        let (radius, end_radius) = (norm(first), norm(last));
        if radius < 1e-6 || end_radius < 1e-6 {
            return Err("the arc's centre is one of its ends");
        }
        let scale = 1.0 / (radius * end_radius);
        let cosine = (first[0] * last[0] + first[1] * last[1]) * scale;
        let cross = (first[0] * last[1] - first[1] * last[0]) * scale;
        let sine = if self.clockwise { -cross } else { cross };
        let reach = radius.max(end_radius);
        let (turn, halvings) = match self.start == self.end {
            true => halve([-1.0, 0.0], 1, reach, tolerance),
            false => halve([cosine, sine], 0, reach, tolerance),
        };
        let count = 1 << halvings;
        let angle = angle_of(turn) * f64::from(count);
        Ok(Chords {
            centre,
            first,
            turn: [turn[0], if self.clockwise { -turn[1] } else { turn[1] }],
            growth: end_radius / radius,
            count,
            length: angle * (radius + end_radius) / 2.0,
            mismatch: (end_radius - radius).abs(),
        })
    }

    fn offset_by_radius(&self, radius: f64) -> Result<[f64; 2], &'static str> {
        let chord = [self.end[0] - self.start[0], self.end[1] - self.start[1]];
        let length = norm(chord);
        if length < 1e-9 {
            return Err("an arc with R needs another end than its start: give I and J for a circle");
        }
        let half = length / 2.0;
        // Rounded coordinates can make the radius of a half circle too short by some micrometres.
        if radius.abs() < half - 0.002 - 0.001 * half {
            return Err("the radius R is too short to reach the arc's end");
        }
        let height = (radius * radius - half * half).max(0.0).sqrt();
        // Left of the chord lies the centre of the minor counterclockwise arc.
        let side = if self.clockwise == (radius > 0.0) { -height } else { height } / length;
        Ok([chord[0] / 2.0 - chord[1] * side, chord[1] / 2.0 + chord[0] * side])
    }
}

impl Chords {
    /// The end points of all chords but the last, which ends where the arc does.
    pub(super) fn inner_points(&self) -> impl Iterator<Item = [f64; 2]> + use<> {
        let Chords { centre, turn, growth, count, .. } = *self;
        let mut spoke = self.first;
        (1..count).map(move |step| {
            spoke = [spoke[0] * turn[0] - spoke[1] * turn[1], spoke[0] * turn[1] + spoke[1] * turn[0]];
            let scale = 1.0 + (growth - 1.0) * f64::from(step) / f64::from(count);
            [centre[0] + spoke[0] * scale, centre[1] + spoke[1] * scale]
        })
    }
}

fn norm(v: [f64; 2]) -> f64 {
    (v[0] * v[0] + v[1] * v[1]).sqrt()
}

/// Halves an angle between 0 and 2π, given by cosine and sine, until its chord keeps the tolerance. Returns
/// what is left of it and how often it was halved, `done` included.
fn halve(angle: [f64; 2], done: u32, radius: f64, tolerance: f64) -> ([f64; 2], u32) {
    let ([mut cosine, mut sine], mut halvings) = (angle, done);
    while halvings < HALVINGS_MAX {
        // The sagitta, r·(1 − cos(angle/2)), without cancellation; an angle beyond a half turn is too wide.
        let half = half_of(cosine, sine);
        if sine >= 0.0 && cosine > -0.5 && radius * half[1] * half[1] / (1.0 + half[0]) <= tolerance {
            break;
        }
        [cosine, sine] = half;
        halvings += 1;
    }
    ([cosine, sine], halvings)
}

/// Cosine and sine of half an angle between 0 and 2π.
fn half_of(cosine: f64, sine: f64) -> [f64; 2] {
    // Whichever of the two is larger comes from a root without cancellation, the other one from the sine.
    if cosine >= 0.0 {
        let half = ((1.0 + cosine.min(1.0)) / 2.0).sqrt();
        if sine >= 0.0 { [half, sine / (2.0 * half)] } else { [-half, -sine / (2.0 * half)] }
    } else {
        let half = ((1.0 - cosine.max(-1.0)) / 2.0).sqrt();
        [sine / (2.0 * half), half]
    }
}

/// An angle between 0 and a third of a turn from its cosine and sine: halved until it equals its sine.
fn angle_of([mut cosine, mut sine]: [f64; 2]) -> f64 {
    const HALVINGS: i32 = 27;
    for _ in 0..HALVINGS {
        [cosine, sine] = half_of(cosine, sine);
    }
    sine * f64::from(1 << HALVINGS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn walk(arc: Arc, tolerance: f64) -> (Chords, Vec<[f64; 2]>) {
        let chords = arc.chords(tolerance).unwrap();
        (chords, chords.inner_points().chain([arc.end]).collect())
    }

    #[test]
    fn radius_form_takes_the_minor_or_the_major_arc() {
        let arc = |radius, clockwise| Arc {
            start: [15.0, 15.0],
            end: [20.0, 20.0],
            centre: Centre::Radius(radius),
            clockwise,
        };
        for (radius, clockwise, centre, length) in [
            (5.0, false, [15.0, 20.0], 2.5 * PI),
            (5.0, true, [20.0, 15.0], 2.5 * PI),
            (-5.0, false, [20.0, 15.0], 7.5 * PI),
            (-5.0, true, [15.0, 20.0], 7.5 * PI),
        ] {
            let (chords, points) = walk(arc(radius, clockwise), 1e-3);
            assert!((chords.length - length).abs() < 1e-12, "{radius} {clockwise}: {}", chords.length);
            for p in points {
                assert!((norm([p[0] - centre[0], p[1] - centre[1]]) - 5.0).abs() < 1e-12);
            }
        }
        assert!(arc(3.0, true).chords(1e-3).is_err());
    }

    proptest! {
        #[test]
        fn chords_keep_the_tolerance(
            radius in 0.01f64..2000.0, from in 0.0f64..360.0, sweep in 0.01f64..359.9, tolerance in 1e-3f64..0.2,
            clockwise: bool,
        ) {
            let at = |degrees: f64| [radius * degrees.to_radians().cos(), radius * degrees.to_radians().sin()];
            let start = at(from);
            let end = at(if clockwise { from - sweep } else { from + sweep });
            let arc = Arc { start, end, centre: Centre::Offset([-start[0], -start[1]]), clockwise };
            let (chords, points) = walk(arc, tolerance);
            prop_assert!((chords.length - radius * sweep.to_radians()).abs() < 1e-9 * radius.max(1.0));
            let mut last = start;
            for p in points {
                let middle = [(last[0] + p[0]) / 2.0, (last[1] + p[1]) / 2.0];
                prop_assert!((norm(p) - radius).abs() < 1e-9 * radius.max(1.0));
                prop_assert!(radius - norm(middle) <= tolerance * 1.000001);
                let cross = (last[0] * p[1] - last[1] * p[0]) * if clockwise { -1.0 } else { 1.0 };
                prop_assert!(cross > 0.0, "a step backwards");
                last = p;
            }
        }
    }
}
