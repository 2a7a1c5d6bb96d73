//! Arcs (G2, G3) as chords, with + - * / and the square root alone: the same file gives the same bits on every
//! machine.

/// Most chords of an arc, 2 to this power. A circle of 100 m within 1 µm needs 2^15.
const HALVINGS_MAX: u32 = 20;

/// Where an arc's centre is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Centre {
    /// At this offset from the start, along the plane's two axes (words I, J, K).
    Offset([f64; 2]),
    /// At this distance (word R); of the two arcs the shorter one if positive, the longer one if negative.
    Radius(f64),
}

/// An arc in its plane, seen against the plane's normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Arc {
    pub(crate) start: [f64; 2],
    pub(crate) end: [f64; 2],
    pub(crate) centre: Centre,
    pub(crate) clockwise: bool,
    /// Full turns before the arc proper.
    pub(crate) turns: u32,
}

/// Most chords of all turns of one arc.
const CHORDS_MAX: u64 = 1 << HALVINGS_MAX;

/// Chords of equal angle: of the full turns before an arc, and of the arc proper.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chords {
    centre: [f64; 2],
    /// From the centre to the start.
    first: [f64; 2],
    circle: ArcChords,
    turns: u32,
    arc: ArcChords,
    /// Part of the whole angle that lies within the arc proper.
    arc_part: f64,
    /// Length of the end's radius, as a part of the start's.
    growth: f64,
    /// Length of the arc within the plane.
    pub(crate) length: f64,
    /// By how much the ends' distances from the centre differ; the radius changes evenly between them.
    pub(crate) mismatch: f64,
}

/// Chords of equal angle.
#[derive(Clone, Copy, Debug)]
struct ArcChords {
    /// Cosine and sine of the angle of a chord, counterclockwise.
    turn: [f64; 2],
    count: u32,
}

impl Arc {
    /// The chords that deviate from the arc by `tolerance` at most. Start and end alike make a full circle.
    ///
    /// # Errors
    /// If no such arc exists, with the reason.
    pub(crate) fn chords(&self, tolerance: f64) -> Result<Chords, &'static str> {
        let offset = self.centre_offset()?;
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
        let leg = |(turn, halvings): ([f64; 2], u32)| {
            (
                angle_of(turn) * f64::from(1u32 << halvings),
                ArcChords {
                    turn: [turn[0], if self.clockwise { -turn[1] } else { turn[1] }],
                    count: 1 << halvings,
                },
            )
        };
        let (full_angle, circle) = leg(halve([-1.0, 0.0], 1, reach, tolerance));
        let (arc_angle, arc) = match self.start == self.end {
            true => (full_angle, circle),
            false => leg(halve([cosine, sine], 0, reach, tolerance)),
        };
        let angle = match self.turns {
            0 => arc_angle,
            turns => f64::from(turns) * full_angle + arc_angle,
        };
        let chords = Chords {
            centre,
            first,
            circle,
            turns: self.turns,
            arc,
            arc_part: if self.turns == 0 { 1.0 } else { arc_angle / angle },
            growth: end_radius / radius,
            length: angle * (radius + end_radius) / 2.0,
            mismatch: (end_radius - radius).abs(),
        };
        match chords.count() {
            ..=CHORDS_MAX => Ok(chords),
            _ => Err("the arc has so many turns that they become more than a million chords"),
        }
    }

    /// The centre from the start.
    ///
    /// # Errors
    /// If no such arc exists, with the reason.
    pub(crate) fn centre_offset(&self) -> Result<[f64; 2], &'static str> {
        match self.centre {
            Centre::Offset(offset) => Ok(offset),
            Centre::Radius(radius) => self.offset_by_radius(radius),
        }
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
    /// Number of chords.
    pub(crate) fn count(&self) -> u64 {
        u64::from(self.turns) * u64::from(self.circle.count) + u64::from(self.arc.count)
    }

    /// The end points of all chords but the last, which ends where the arc does; each with the part of the whole angle
    /// that it ends.
    pub(crate) fn inner_points(&self) -> impl Iterator<Item = ([f64; 2], f64)> + use<> {
        let Chords { centre, first, circle, turns, arc, arc_part, growth, .. } = *self;
        let turn_part = (1.0 - arc_part) / f64::from(turns.max(1));
        let legs = (0..turns).map(move |turn| (circle, f64::from(turn) * turn_part, turn_part));
        let steps = legs.chain([(arc, 1.0 - arc_part, arc_part)]).flat_map(move |(leg, begin, part)| {
            let mut spoke = first;
            (1..=leg.count).map(move |step| {
                let [cosine, sine] = leg.turn;
                spoke = [spoke[0] * cosine - spoke[1] * sine, spoke[0] * sine + spoke[1] * cosine];
                (spoke, begin + part * (f64::from(step) / f64::from(leg.count)))
            })
        });
        steps.take(self.count() as usize - 1).map(move |(spoke, part)| {
            let scale = 1.0 + (growth - 1.0) * part;
            ([centre[0] + spoke[0] * scale, centre[1] + spoke[1] * scale], part)
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
        (chords, chords.inner_points().map(|(point, _)| point).chain([arc.end]).collect())
    }

    #[test]
    fn radius_form_takes_the_minor_or_the_major_arc() {
        let arc = |radius, clockwise| Arc {
            start: [15.0, 15.0],
            end: [20.0, 20.0],
            centre: Centre::Radius(radius),
            clockwise,
            turns: 0,
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

    #[test]
    fn turns_stand_before_the_arc() {
        let arc = |turns, end| Arc {
            start: [0.0, 10.0],
            end,
            centre: Centre::Offset([0.0, -10.0]),
            clockwise: true,
            turns,
        };
        for (turns, end, length) in [
            (0, [10.0, 0.0], 5.0 * PI),
            (1, [10.0, 0.0], 25.0 * PI),
            (2, [0.0, 10.0], 60.0 * PI),
            (7, [-10.0, 0.0], 155.0 * PI),
        ] {
            let arc = arc(turns, end);
            let (chords, points) = walk(arc, 1e-3);
            assert!((chords.length - length).abs() < 1e-9, "{turns}: {}", chords.length);
            assert_eq!(points.len() as u64, chords.count());
            assert!(points.iter().all(|p| (norm(*p) - 10.0).abs() < 1e-9));
            let steps = [arc.start].into_iter().chain(points.iter().copied());
            let walked: f64 = steps.zip(&points).map(|(a, b)| norm([b[0] - a[0], b[1] - a[1]])).sum();
            assert!((walked / length - 1.0).abs() < 1e-3, "{turns}: {walked}");
            let parts: Vec<f64> = chords.inner_points().map(|(_, part)| part).collect();
            assert!(parts.windows(2).all(|pair| pair[0] < pair[1]) && parts[parts.len() - 1] < 1.0);
        }
        assert!(arc(u32::MAX, [10.0, 0.0]).chords(1e-6).is_err());
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
            let arc = Arc { start, end, centre: Centre::Offset([-start[0], -start[1]]), clockwise, turns: 0 };
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
