//! Hermite edges of an interior node, from those of its children.

use super::{Hermite, HermiteEdge, Ranks, SignChanges};
use crate::lattice::{Axis, BRICK_POINTS};

/// Index of the first sample that a parent takes of an upper child.
const HALF: usize = BRICK_POINTS / 2;

impl Hermite {
    /// The Hermite edges of a node with these signs; of each child, by octant, its own signs and edges, `None` where it
    /// has no sign changes.
    ///
    /// An edge consists of two edges of the child that owns its lower end. Its ends differ in sign, so exactly one of
    /// the two changes sign: the edge has its crossing, at half the distance, rounded down, and its normal.
    ///
    /// A build of that depth finds the same crossing and normal, at a place that is at most one step of 1/65536 away,
    /// because it rounds once and to the nearest.
    ///
    /// Only finer samples can tell otherwise: where the surface passes both halves of an edge, a build of that depth
    /// takes the first passage, but the half that is passed twice keeps none.
    ///
    /// `None` if the edges of a child are not those of its signs, or its signs are not those of the parent.
    pub fn from_children(
        signs: &SignChanges,
        children: &[Option<(SignChanges, Hermite)>; 8],
    ) -> Option<Hermite> {
        let mut coarse = Hermite::default();
        for axis in Axis::ALL {
            let ranks = children.each_ref().map(|child| child.as_ref().map(|(signs, _)| signs.ranks(axis)));
            let mut edges = Vec::new();
            let mut is_sound = true;
            signs.for_edges(axis, |at| {
                let upper = at.map(|c| usize::from(c >= HALF));
                let octant = upper[0] | upper[1] << 1 | upper[2] << 2;
                let low = [0, 1, 2].map(|a| 2 * (at[a] - HALF * upper[a]));
                let edge = match (&children[octant], &ranks[octant]) {
                    (Some((signs, hermite)), Some(ranks)) => {
                        of_two(signs, &hermite.edges[axis.index()], ranks, axis, low)
                    }
                    _ => None,
                };
                is_sound &= edge.is_some();
                edges.extend(edge);
            });
            if !is_sound {
                return None;
            }
            coarse.edges[axis.index()] = edges;
        }
        Some(coarse)
    }
}

/// The edge of twice the length that begins at sample `low` of a child.
fn of_two(
    signs: &SignChanges,
    edges: &[HermiteEdge],
    ranks: &Ranks,
    axis: Axis,
    low: [usize; 3],
) -> Option<HermiteEdge> {
    let mut middle = low;
    middle[axis.index()] += 1;
    let second = signs.is_inside(low) == signs.is_inside(middle);
    let [i, j, k] = if second { middle } else { low };
    if signs.edges(axis, j, k) >> i & 1 == 0 {
        return None;
    }
    let fine = edges.get(signs.rank(axis, [i, j, k], ranks))?;
    let offset = (u32::from(second) << 16 | u32::from(fine.offset)) >> 1;
    Some(HermiteEdge { offset: offset as u16, normal: fine.normal })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::brick::{OctNormal, point_index};
    use crate::lattice::Octant;

    /// A plane across the finest of two levels: each edge of the parent has the crossing that lies on it, and no other
    /// half has one.
    #[test]
    fn a_plane_stays_where_it_is() {
        // x + y + z = 40.375 in parent cells, lower samples inside.
        let plane = |p: [f64; 3]| 40.375 - p.iter().sum::<f64>();
        let normal = OctNormal::from_integer([1, 1, 1]);
        let brick = |origin: [f64; 3], spacing: f64| {
            let at = |ijk: [usize; 3]| [0, 1, 2].map(|a| origin[a] + spacing * ijk[a] as f64);
            let position = |index: usize| at([index % 33, index / 33 % 33, index / 1089]);
            let signs = SignChanges::from_fn(|index| plane(position(index)) >= 0.0);
            let mut hermite = Hermite::default();
            for axis in Axis::ALL {
                let edges = &mut hermite.edges[axis.index()];
                signs.for_edges(axis, |ijk| {
                    let fraction = plane(position(point_index(ijk))) / spacing;
                    edges.push(HermiteEdge { offset: (fraction * 65536.0) as u16, normal });
                });
            }
            (signs, hermite)
        };
        let child = |octant: Octant| brick(octant.offset().map(|o| 16.0 * o as f64), 0.5);
        let all: Vec<_> = Octant::all().map(child).collect();
        let children: [_; 8] = std::array::from_fn(|octant| {
            let (signs, hermite) = all[octant].clone();
            (signs.counts() != [0; 3]).then_some((signs, hermite))
        });
        let (signs, expected) = brick([0.0; 3], 1.0);
        assert!(expected.len() > 1000);
        assert_eq!(Hermite::from_children(&signs, &children), Some(expected));
        // Children that are not the parent's are noticed.
        let mut lacking = children.clone();
        lacking[7] = None;
        lacking[0] = None;
        assert_eq!(Hermite::from_children(&signs, &lacking), None);
        let mut cut = children;
        cut.iter_mut().flatten().for_each(|(_, hermite)| hermite.edges[1].truncate(3));
        assert_eq!(Hermite::from_children(&signs, &cut), None);
    }
}
