//! A segment of a bead as a table has it, and how far a place is from its solid.

/// What stands for one in a tool's axis.
pub const AXIS_ONE: i16 = 1 << 14;
/// The squared sine of the angle between path and tool axis below which the axis does not tell which way is up.
const PARALLEL: f64 = 1e-12;

/// The shape between a bead's width and its height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PickOutline {
    /// A rectangle with half discs at its sides; standing upright where a bead is higher than wide.
    Stadium,
    /// An ellipse.
    Ellipse,
}

/// World lengths of a step: along x and y, and of widths; along z, and of heights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steps {
    /// Along x and y.
    pub across: f64,
    /// Along z.
    pub up: f64,
}

/// Where a place lies beside a segment's solid, in world lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beside {
    /// Its distance from the surface, negative inside.
    pub distance: f64,
    /// How far along the segment the nearest place of the centre line is, 0 to 1.
    pub part: f64,
    /// Its distance from the centre line, as seen from the tool.
    pub across: f64,
}

/// A bead, or a pass of one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PickBead {
    /// Its number, from 0, as `overlap` has it.
    pub number: u32,
    /// Its layer, from 0.
    pub layer: u32,
    /// Its feature among those of the table.
    pub feature: u32,
    /// Its file among those of the table.
    pub source: u32,
    /// First and last line of the file that deposit it, from 1; not known where segments have lines.
    pub lines: (u64, u64),
}

/// A segment of a bead. Its ends lie on the bead's centre line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PickSegment {
    /// One end, in steps.
    pub a: [i32; 3],
    /// The other end.
    pub b: [i32; 3],
    /// Width of the section, in steps across.
    pub width: u32,
    /// Its height, in steps up.
    pub height: u32,
    /// The tool's axis, in parts of [`AXIS_ONE`].
    pub axis: [i16; 3],
    /// Its bead.
    pub bead: PickBead,
    /// The line of the file that deposits it, from 1; 0 where beads have lines.
    pub line: u64,
}

impl PickSegment {
    /// One that says nothing, before the first.
    pub const START: PickSegment = PickSegment {
        a: [0; 3],
        b: [0; 3],
        width: 0,
        height: 0,
        axis: [0, 0, AXIS_ONE],
        bead: PickBead { number: 0, layer: 0, feature: 0, source: 0, lines: (0, 0) },
        line: 0,
    };

    /// The box around its solid, in steps.
    pub fn bounds(&self, steps: Steps) -> ([i32; 3], [i32; 3]) {
        let is_upright = self.axis[0] == 0 && self.axis[1] == 0 && self.a[2] == self.b[2];
        let (half_width, half_height) = (f64::from(self.width) / 2.0, f64::from(self.height) / 2.0);
        // However it is turned, a section lies within half its width and half its height together.
        let reach = match is_upright {
            true => [half_width, half_width, half_height],
            false => {
                let most = half_width * steps.across + half_height * steps.up;
                [most / steps.across, most / steps.across, most / steps.up]
            }
        };
        let (mut low, mut high) = ([0; 3], [0; 3]);
        for a in 0..3 {
            let reach = reach[a].ceil() as i32;
            low[a] = self.a[a].min(self.b[a]).saturating_sub(reach);
            high[a] = self.a[a].max(self.b[a]).saturating_add(reach);
        }
        (low, high)
    }

    /// Where a place lies beside the solid. `at` is in world lengths from the place of no steps. The distance is exact of stadiums,
    /// and near the surface of ellipses to the first order.
    pub fn beside(&self, at: [f64; 3], outline: PickOutline, steps: Steps) -> Beside {
        let scale = [steps.across, steps.across, steps.up];
        let (mut end, mut from) = ([0.0; 3], [0.0; 3]);
        for a in 0..3 {
            end[a] = (f64::from(self.b[a]) - f64::from(self.a[a])) * scale[a];
            from[a] = at[a] - f64::from(self.a[a]) * scale[a];
        }
        let ([forth, side, up], length) = frame(end, self.axis.map(|c| f64::from(c) / f64::from(AXIS_ONE)));
        let along = dot(forth, from);
        let nearest = along.max(0.0).min(length);
        let d = far(along - nearest, dot(side, from));
        let (half_width, half_height) =
            (f64::from(self.width) * steps.across / 2.0, f64::from(self.height) * steps.up / 2.0);
        let distance = match outline {
            PickOutline::Stadium => stadium(d, dot(up, from).abs(), half_width, half_height),
            PickOutline::Ellipse => ellipse(d, dot(up, from), half_width, half_height),
        };
        Beside { distance, part: if length > 0.0 { nearest / length } else { 0.0 }, across: d }
    }

    /// Heights of the bead's lower and upper side at a part of its way, in world lengths from the place of no steps.
    pub fn heights(&self, part: f64, steps: Steps) -> (f64, f64) {
        let [from, to] = [self.a[2], self.b[2]].map(|z| f64::from(z) * steps.up);
        let middle = from + (to - from) * part;
        let half = f64::from(self.height) * steps.up / 2.0;
        let half = half * f64::from(self.axis[2]).abs() / f64::from(AXIS_ONE);
        (middle - half, middle + half)
    }
}

/// From a stadium's border, of a place so far from its middle across and up.
fn stadium(d: f64, up: f64, half_width: f64, half_height: f64) -> f64 {
    let radius = half_width.min(half_height);
    let (x, y) = (d - (half_width - radius), up - (half_height - radius));
    far(x.max(0.0), y.max(0.0)) + x.max(y).min(0.0) - radius
}

/// From an ellipse's border, to the first order.
fn ellipse(d: f64, up: f64, half_width: f64, half_height: f64) -> f64 {
    let (x, y) = (d / half_width, up / half_height);
    let share = far(x, y);
    let slope = far(x / half_width, y / half_height);
    if slope > 0.0 {
        (share - 1.0) * share / slope
    } else {
        -half_width.min(half_height)
    }
}

/// Unit vectors along a segment, to its side and upward, and its length: as the solids of the program have them.
fn frame(end: [f64; 3], axis: [f64; 3]) -> ([[f64; 3]; 3], f64) {
    let length = dot(end, end).sqrt();
    let forth = if length > 0.0 { end.map(|c| c / length) } else { across(axis) };
    // Upper sides of one layer are to lie equally high.
    if axis[0] == 0.0 && axis[1] == 0.0 && forth[2] == 0.0 {
        return ([forth, [-forth[1], forth[0], 0.0], [0.0, 0.0, 1.0]], length);
    }
    let mut side = cross(axis, forth);
    if dot(side, side) < PARALLEL {
        side = cross(across(forth), forth);
    }
    let size = dot(side, side).sqrt();
    let side = side.map(|c| c / size);
    ([forth, side, cross(forth, side)], length)
}

/// A unit vector perpendicular to a vector that is not 0, of which the coordinate axis farthest from it is not far.
fn across(v: [f64; 3]) -> [f64; 3] {
    let least = (1..3).fold(0, |least, a| if v[a].abs() < v[least].abs() { a } else { least });
    let share = v[least] / dot(v, v);
    let mut w = v.map(|c| -share * c);
    w[least] += 1.0;
    let size = dot(w, w).sqrt();
    w.map(|c| c / size)
}

/// The length of a vector in a plane.
fn far(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
