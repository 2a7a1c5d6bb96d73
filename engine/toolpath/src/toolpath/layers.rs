//! Where the layers of a toolpath lie.

use super::Toolpath;

impl Toolpath {
    /// How many layers there are.
    pub fn layers(&self) -> u32 {
        (0..self.len()).map(|bead| self.attributes(bead).layer + 1).max().unwrap_or(0)
    }

    /// Lowest and highest z of a layer, numbered from 0 as in [`Attributes::layer`](super::Attributes::layer): of its beads'
    /// lower sides and of their upper ones. `None` if no bead is in it.
    pub fn extent_of_layer(&self, layer: u32) -> Option<[f64; 2]> {
        let mut extent: Option<[f64; 2]> = None;
        for bead in (0..self.len()).filter(|bead| self.attributes(*bead).layer == layer) {
            for (n, segment) in self.points(bead).windows(2).enumerate() {
                let height = self.section(bead, n).height;
                for (point, [_, _, z]) in segment.iter().enumerate() {
                    let below = z - self.axis(bead, n + point)[2] * height;
                    let [low, high] = extent.unwrap_or([f64::INFINITY, f64::NEG_INFINITY]);
                    extent = Some([low.min(*z).min(below), high.max(*z).max(below)]);
                }
            }
        }
        extent
    }
}

#[cfg(test)]
mod tests {
    use crate::toolpath::{Attributes, BeadView, Section, Toolpath};

    #[test]
    fn layers_lie_between_the_lower_and_the_upper_sides_of_their_beads() {
        let mut toolpath = Toolpath::default();
        assert_eq!((toolpath.layers(), toolpath.extent_of_layer(0)), (0, None));
        for (layer, z, height) in [(0, 0.3, 0.3), (2, 0.7, 0.2), (2, 0.75, 0.2)] {
            toolpath.push(BeadView {
                points: &[[0.0, 0.0, z], [1.0, 0.0, z]],
                axes: &[],
                sections: &[Section { width: 0.5, height }],
                lines: &[],
                attributes: Attributes { layer, tool: 0, feature: 0, lines: (1, 1), fed: None },
            });
        }
        assert_eq!(toolpath.layers(), 3);
        let extents = [0, 1, 2, 3].map(|layer| toolpath.extent_of_layer(layer));
        let near = |found: Option<[f64; 2]>, low: f64, high: f64| {
            found.is_some_and(|[a, b]| (a - low).abs() < 1e-12 && (b - high).abs() < 1e-12)
        };
        assert!(near(extents[0], 0.0, 0.3) && near(extents[2], 0.5, 0.75), "{extents:?}");
        assert_eq!([extents[1], extents[3]], [None, None]);
    }
}
