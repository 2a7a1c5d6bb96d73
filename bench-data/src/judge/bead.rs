//! A segment of a bead as a solid: a section of the shape of a stadium, swept along a straight line, with round ends.

use crate::Rng;
use crate::vector::{V3, add, cross, dot, norm, scale, sub, unit};
use std::f64::consts::PI;

/// Outer size of a bead across its path, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeadSize {
    /// Along the layer.
    pub width: f64,
    /// Across the layer.
    pub height: f64,
}

impl BeadSize {
    /// Area of the stadium: half circles at the sides of a wide bead, at top and bottom of an upright one.
    pub fn area(&self) -> f64 {
        let (short, long) = (self.width.min(self.height), self.width.max(self.height));
        short * (long - short) + 0.25 * PI * short * short
    }

    /// The width with which a section of this height has an area.
    pub fn width_of(area: f64, height: f64) -> f64 {
        let corner = 1.0 - 0.25 * PI;
        if area >= 0.25 * PI * height * height {
            area / height + height * corner
        } else {
            // Upright: height × width less the corners of the width's square.
            (height - (height * height - 4.0 * corner * area).max(0.0).sqrt()) / (2.0 * corner)
        }
    }

    /// Volume of the section turned about its upright middle line: the two round ends of a segment.
    pub fn ends(&self) -> f64 {
        let [flat, upright, round] = self.parts();
        PI * (2.0 * flat * flat * round + PI * flat * round * round + 4.0 / 3.0 * round.powi(3))
            + 2.0 * upright * PI * round * round
    }

    /// Half lengths of what is straight, sideways and upright, and the radius around it. One of the first two is zero.
    fn parts(&self) -> [f64; 3] {
        let half = 0.5 * (self.width - self.height);
        [half.max(0.0), (-half).max(0.0), 0.5 * self.width.min(self.height)]
    }

    /// Whether a point at this distance from the upright middle line and this height above the middle is inside.
    fn covers(&self, aside: f64, above: f64) -> bool {
        let [flat, upright, round] = self.parts();
        let (x, z) = ((aside.abs() - flat).max(0.0), (above.abs() - upright).max(0.0));
        x * x + z * z <= round * round
    }
}

/// The solid of one segment.
#[derive(Clone, Debug)]
pub(crate) struct BeadSolid {
    /// The first end of its middle line.
    pub start: V3,
    length: f64,
    /// Unit vectors along it, to its side, and across the layer.
    frame: [V3; 3],
    pub section: BeadSize,
}

impl BeadSolid {
    /// The solid below a segment of the path of the tool's tip, which is the middle of the bead's upper side.
    pub fn new(from: V3, to: V3, section: BeadSize) -> BeadSolid {
        let way = sub(to, from);
        let length = norm(way);
        let along = if length > 0.0 { scale(way, 1.0 / length) } else { [1.0, 0.0, 0.0] };
        let across = [along[1], -along[0], 0.0];
        let side = if norm(across) > 1e-6 { unit(across) } else { [0.0, 1.0, 0.0] };
        let start = [from[0], from[1], from[2] - 0.5 * section.height];
        BeadSolid { start, length, frame: [along, side, cross(side, along)], section }
    }

    /// The round end at the segment's start, as a solid of its own.
    pub fn first_end(&self) -> BeadSolid {
        BeadSolid { length: 0.0, ..self.clone() }
    }

    pub fn volume(&self) -> f64 {
        self.section.area() * self.length + self.section.ends()
    }

    /// Whether a point is inside. A segment that climbs has its section at right angles to itself, ends included.
    pub fn covers(&self, p: V3) -> bool {
        let [along, side, above] = self.frame.map(|axis| dot(axis, sub(p, self.start)));
        let beyond = along - along.clamp(0.0, self.length);
        self.section.covers(beyond.hypot(side), above)
    }

    /// A point that divides the volume as `part` in 0..1 does along the segment, then round its ends; else at random.
    pub fn point(&self, part: f64, rng: &mut Rng) -> V3 {
        let BeadSize { width, height } = self.section;
        let (way, radius) = (part * self.volume() / self.section.area(), 0.5 * width);
        loop {
            let (side, above) = (rng.range(-radius, radius), rng.range(-0.5, 0.5) * height);
            if way < self.length {
                if self.section.covers(side, above) {
                    return self.at([way, side, above]);
                }
                continue;
            }
            let beyond = rng.range(-radius, radius);
            if self.section.covers(beyond.hypot(side), above) {
                return self.at([if beyond < 0.0 { beyond } else { self.length + beyond }, side, above]);
            }
        }
    }

    /// Boxes that hold the solid together, none of them longer than `step` and the section's width.
    pub fn boxes(&self, step: f64) -> impl Iterator<Item = [V3; 2]> + '_ {
        let reach = if self.frame[0][2] == 0.0 {
            [0.5 * self.section.width, 0.5 * self.section.width, 0.5 * self.section.height]
        } else {
            [0.5 * (self.section.width + self.section.height); 3]
        };
        let count = (self.length / step.max(self.section.width)).ceil().max(1.0);
        (0..count as u64).map(move |n| {
            let end = |n: f64| self.at([self.length * n / count, 0.0, 0.0]);
            let (a, b) = (end(n as f64), end(n as f64 + 1.0));
            [[0, 1, 2].map(|k| a[k].min(b[k]) - reach[k]), [0, 1, 2].map(|k| a[k].max(b[k]) + reach[k])]
        })
    }

    fn at(&self, place: V3) -> V3 {
        (0..3).fold(self.start, |p, k| add(p, scale(self.frame[k], place[k])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECTIONS: [BeadSize; 3] = [
        BeadSize { width: 0.5, height: 0.2 },
        BeadSize { width: 0.2, height: 0.2 },
        BeadSize { width: 0.2, height: 0.5 },
    ];

    #[test]
    fn volumes_are_those_of_points_in_a_box() {
        for section in SECTIONS {
            let solid = BeadSolid::new([0.0, 0.0, 1.0], [0.3, 0.4, 1.2], section);
            let ([low, high], mut rng) = (solid.boxes(10.0).next().unwrap(), Rng::new(5));
            let box_volume: f64 = (0..3).map(|k| high[k] - low[k]).product();
            let random = |rng: &mut Rng| [0, 1, 2].map(|k| rng.range(low[k], high[k]));
            let hits = (0..400_000).filter(|_| solid.covers(random(&mut rng))).count();
            let found = box_volume * hits as f64 / 400_000.0;
            assert!((found / solid.volume() - 1.0).abs() < 0.02, "{section:?}: {found}, {}", solid.volume());
        }
    }

    #[test]
    fn points_are_spread_evenly_over_the_solid() {
        for section in SECTIONS {
            let solid = BeadSolid::new([1.0, 2.0, 3.0], [2.0, 1.0, 3.0], section);
            let mut rng = Rng::new(9);
            let parts = 100_000;
            let points: Vec<V3> =
                (0..parts).map(|n| solid.point((f64::from(n) + 0.5) / f64::from(parts), &mut rng)).collect();
            assert!(points.iter().filter(|p| solid.covers(**p)).count() as u32 > parts - 10);
            // A ball within has the part of the points that it has of the volume.
            let (middle, radius) = ([1.03, 1.97, 3.0 - 0.5 * section.height], 0.09);
            let inside = points.iter().filter(|p| norm(sub(**p, middle)) < radius).count();
            let part = 4.0 / 3.0 * PI * radius.powi(3) / solid.volume();
            let found = inside as f64 / f64::from(parts);
            assert!((found / part - 1.0).abs() < 0.06, "{section:?}: {found}, {part}");
        }
    }

    #[test]
    fn a_width_follows_from_the_area() {
        for section in SECTIONS {
            assert!((BeadSize::width_of(section.area(), section.height) - section.width).abs() < 1e-12);
        }
    }
}
