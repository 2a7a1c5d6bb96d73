//! A sharp part: a block with bosses on its sides and pockets in them.
//!
//! Boxes, wedges and cylinders of many facets, each turned at random about a place on one of the six sides, sixteen a
//! side, and everything turned once more, so that no face is parallel to an axis. Half of the pieces are added, the others
//! turned inside out, so that w is 0 in a pocket, and −1 where such a piece reaches out of the block. Pieces do not meet
//! each other: {w ≥ 0.5} is the block and the bosses less the pockets, and every boss and pocket is cut by a side.

use crate::shapes::{Polygon, cuboid, extrude};
use crate::vector::{V3, norm};
use crate::{Mesh, Rng};

/// Edge of the block, mm.
const BLOCK: f64 = 60.0;
/// Pieces along an edge of a side, and between their middles, mm.
const SITES: u32 = 4;
const PITCH: f64 = 12.0;
/// No point of a piece is farther from its middle: less than half the pitch, mm.
const REACH: f64 = 5.5;
/// Sides of the cylinders.
const SIDES: u32 = 64;

/// The block, and 96 pieces in its sides. Those that are to be taken away are inside out.
pub fn sharp_part(seed: u64) -> Vec<Mesh> {
    let mut rng = Rng::new(seed);
    let mut pieces = vec![cuboid([0.0; 3], [BLOCK; 3])];
    for side in 0..6 {
        for site in 0..SITES * SITES {
            let along = |n: u32| PITCH * f64::from(n + 1);
            let mut middle = [0.0; 3];
            middle[side / 2] = if side % 2 == 0 { 0.0 } else { BLOCK };
            middle[(side / 2 + 1) % 3] = along(site % SITES);
            middle[(side / 2 + 2) % 3] = along(site / SITES);
            let piece = piece(&mut rng).rotated_by(rng.quaternion()).translated(middle);
            pieces.push(if rng.one_in(2) { piece.flipped() } else { piece });
        }
    }
    pieces.into_iter().map(|piece| piece.rotated([1.0, 2.0, 3.0], 0.5)).collect()
}

/// A box, a wedge or a cylinder about the origin, whose farthest corner is [`REACH`] away.
fn piece(rng: &mut Rng) -> Mesh {
    let mesh = match rng.below(3) {
        0 => {
            let half: V3 = std::array::from_fn(|_| rng.range(0.6, 1.0));
            cuboid(half.map(|h| -h), half)
        }
        1 => {
            let (left, right) = (rng.range(0.7, 1.0), rng.range(0.7, 1.0));
            extrude(&Polygon(vec![[-left, -0.6], [right, -0.6], [rng.range(-0.3, 0.3), 0.9]]), -0.8, 0.8)
        }
        _ => {
            let half = rng.range(0.5, 1.0);
            extrude(&Polygon::regular(SIDES, rng.range(0.6, 1.0)), -half, half)
        }
    };
    let farthest = mesh.vertices.iter().map(|&v| norm(v)).fold(0.0, f64::max);
    mesh.scaled([REACH / farthest; 3])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::boundary::Union;
    use crate::judge::mesh::check_soup;
    use crate::judge::tree::Bvh;

    #[test]
    fn pieces_are_closed_and_half_of_them_are_taken_away() {
        let part = sharp_part(1);
        assert_eq!(part.len(), 97);
        assert!(part.iter().all(|piece| check_soup(&piece.soup()).is_closed_manifold()));
        let added = part.iter().filter(|piece| piece.signed_volume() > 0.0).count();
        assert!((40..60).contains(&added), "{added}");
    }

    #[test]
    fn the_union_is_the_block_and_bosses_less_the_pockets() {
        let part = sharp_part(1);
        let whole = Mesh::merged(&part);
        let (low, high) = whole.bounds();
        let union = Union::new(whole.soup());
        let alone = |piece: &Mesh| (piece.signed_volume() > 0.0, Bvh::new(piece.soup()));
        let pieces: Vec<(bool, Bvh)> = part.iter().map(alone).collect();
        let (mut rng, mut pockets) = (Rng::new(2), 0);
        for _ in 0..5000 {
            let p = std::array::from_fn(|k| rng.range(low[k], high[k]));
            let within =
                |added| pieces.iter().any(|(is_added, tree)| *is_added == added && tree.windings([p]) != [0]);
            assert_eq!(union.is_inside(p), within(true) && !within(false), "{p:?}");
            pockets += usize::from(within(true) && within(false));
        }
        assert!(pockets > 20, "{pockets}");
    }
}
