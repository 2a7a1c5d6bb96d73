//! Where a large splat ends, so that rows of pixels are filled without tests.

use super::place::SeenSplat;
use super::view::{dot, RADIUS, REACH};

/// What ends a splat, as rows of pixels meet it: an ellipse, and lines that the planes of cell, cuts and neighbours leave.
pub(super) struct SplatEdges {
    /// Coefficients of xx, xy, yy, x, y, 1: not above 0 inside.
    ellipse: [f32; 6],
    /// Coefficients of x, y, 1, and one divided by the first.
    lines: [[f32; 4]; LINES_MAX],
    count: usize,
    start: [f32; 2],
    columns: f32,
}

/// Six sides of the cell, two cuts, three ends.
const LINES_MAX: usize = 11;

impl SplatEdges {
    /// Nothing if an ellipse is none, since its plane is almost seen from its edge.
    pub fn new<const PARALLEL: bool>(splat: &SeenSplat) -> Option<SplatEdges> {
        // 1/t, of which all is a multiple.
        let one = if PARALLEL { [0.0, 0.0, 1.0] } else { [splat.slope[0], splat.slope[1], splat.s] };
        let square = RADIUS * RADIUS;
        let (across, down) = (splat.across, splat.down);
        let ellipse = [
            dot(across, across) - square * one[0] * one[0],
            dot(across, down) - square * one[0] * one[1],
            dot(down, down) - square * one[1] * one[1],
            -square * one[0] * one[2],
            -square * one[1] * one[2],
            -square * one[2] * one[2],
        ];
        if ellipse[0] <= 0.0 {
            return None;
        }
        let columns = (splat.end[0] - splat.first[0]) as f32;
        let mut edges =
            SplatEdges { ellipse, lines: [[0.0; 4]; LINES_MAX], count: 0, start: splat.start, columns };
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        for (axis, moved) in axes.iter().zip(&splat.moved) {
            edges.add(splat, one, *axis, REACH - moved);
            edges.add(splat, one, axis.map(|c| -c), REACH + moved);
        }
        for (normal, d) in &splat.cuts[..splat.cut_count] {
            edges.add(splat, one, *normal, *d);
        }
        if let Some(highest) = splat.highest {
            (0..3).for_each(|a| edges.add(splat, one, axes[a], highest[a]));
        }
        Some(edges)
    }

    /// What is left where normal · place ≤ d.
    #[inline(always)]
    fn add(&mut self, splat: &SeenSplat, one: [f32; 3], normal: [f32; 3], d: f32) {
        let x = dot(normal, splat.across) - d * one[0];
        let y = dot(normal, splat.down) - d * one[1];
        self.lines[self.count] = [x, y, -d * one[2], 1.0 / x];
        self.count += 1;
    }

    /// Columns of a row in which the splat is: the first, and the one behind the last.
    #[inline(always)]
    pub fn columns(&self, row: usize) -> (usize, usize) {
        let y = self.start[1] + row as f32;
        let [xx, xy, yy, x, y1, one] = self.ellipse;
        let (b, c) = (xy * y + x, (yy * y + 2.0 * y1) * y + one);
        let root = b * b - xx * c;
        if root < 0.0 {
            return (0, 0);
        }
        let root = root.sqrt();
        let (mut low, mut high) = ((-b - root) / xx, (-b + root) / xx);
        for [x, along, one, per] in &self.lines[..self.count] {
            let rest = along * y + one;
            if *x > 0.0 {
                high = high.min(-rest * per);
            } else if *x < 0.0 {
                low = low.max(-rest * per);
            } else if rest > 0.0 {
                return (0, 0);
            }
        }
        let first = (low - self.start[0]).ceil().max(0.0);
        let end = (high - self.start[0]).floor().min(self.columns - 1.0) + 1.0;
        if first < end {
            (first as usize, end as usize)
        } else {
            (0, 0)
        }
    }
}
