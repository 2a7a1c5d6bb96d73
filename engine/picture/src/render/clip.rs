//! What is cut away: half-spaces and boxes across the axes.

use super::camera::{Ray, Vector};
use crate::lattice::Axis;

/// A plane across an axis, and the side of it that is cut away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutPlane {
    /// The axis.
    pub axis: Axis,
    /// Where on it, in world coordinates.
    pub at: f64,
    /// Whether what lies above is cut away, or what lies below.
    pub above: bool,
}

/// The part of a ray that is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RaySpan {
    pub from: f64,
    pub to: f64,
    /// Where the ray comes in through a plane of a cut: the normal of that plane towards the eye.
    pub cut: Option<Vector>,
}

/// A box of which some sides are cuts.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClipBox {
    corners: [Vector; 2],
    is_cut: [[bool; 3]; 2],
}

impl ClipBox {
    /// All of the box `corners` that no cut takes away.
    pub fn new(corners: [Vector; 2], cuts: &[CutPlane]) -> ClipBox {
        let mut clip = ClipBox { corners, is_cut: [[false; 3]; 2] };
        for cut in cuts {
            let (axis, side) = (cut.axis.index(), usize::from(cut.above));
            let bound = &mut clip.corners[side][axis];
            if cut.above && cut.at < *bound || !cut.above && cut.at > *bound {
                *bound = cut.at;
                clip.is_cut[side][axis] = true;
            }
        }
        clip
    }

    /// Least and greatest coordinates of what is left.
    pub fn corners(&self) -> [Vector; 2] {
        self.corners
    }

    /// Which sides are cuts: of the lower ones, and of the upper ones, by axis.
    pub fn cut_sides(&self) -> [[bool; 3]; 2] {
        self.is_cut
    }

    /// Whether nothing is left.
    pub fn is_empty(&self) -> bool {
        (0..3).any(|a| self.corners[0][a] >= self.corners[1][a])
    }

    /// The part of a ray from its origin on that lies within.
    pub fn span(&self, ray: &Ray) -> Option<RaySpan> {
        let mut span = RaySpan { from: 0.0, to: f64::INFINITY, cut: None };
        for a in 0..3 {
            let (origin, d) = (ray.origin[a], ray.direction[a]);
            if d == 0.0 {
                if origin < self.corners[0][a] || origin >= self.corners[1][a] {
                    return None;
                }
                continue;
            }
            let near = usize::from(d < 0.0);
            let [enters, leaves] = [near, 1 - near].map(|side| (self.corners[side][a] - origin) / d);
            if enters > span.from {
                let mut normal = [0.0; 3];
                normal[a] = -d.signum();
                span.from = enters;
                span.cut = self.is_cut[near][a].then_some(normal);
            }
            span.to = span.to.min(leaves);
        }
        (span.from < span.to).then_some(span)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_are_cut_where_planes_are() {
        let cuts = [
            CutPlane { axis: Axis::X, at: 3.0, above: true },
            CutPlane { axis: Axis::Z, at: -9.0, above: false },
        ];
        let clip = ClipBox::new([[0.0; 3], [4.0; 3]], &cuts);
        assert_eq!(clip.corners(), [[0.0; 3], [3.0, 4.0, 4.0]]);
        let ray = |origin, direction| clip.span(&Ray { origin, direction });
        let cut = Some([1.0, 0.0, 0.0]);
        assert_eq!(ray([10.0, 1.0, 1.0], [-1.0, 0.0, 0.0]), Some(RaySpan { from: 7.0, to: 10.0, cut }));
        assert_eq!(ray([1.0, 1.0, 9.0], [0.0, 0.0, -1.0]), Some(RaySpan { from: 5.0, to: 9.0, cut: None }));
        assert_eq!(ray([1.0, 1.0, 9.0], [0.0, 0.0, 1.0]), None);
        assert_eq!(ray([3.5, 1.0, 9.0], [0.0, 0.0, -1.0]), None);
        assert!(!clip.is_empty());
        assert!(
            ClipBox::new([[0.0; 3], [4.0; 3]], &[CutPlane { axis: Axis::Y, at: 0.0, above: true }])
                .is_empty()
        );
    }
}
