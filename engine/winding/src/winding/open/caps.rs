//! Surfaces that close the loops of a boundary.

use super::loops::Loops;
use crate::lattice::{Triangle, Units};

/// Triangles whose boundary is the reverse of all loops together, some of them without area.
pub(super) fn close(loops: &Loops) -> Vec<Triangle> {
    let mut caps = Vec::new();
    let mut ring = Vec::new();
    for vertices in loops.iter() {
        ring.clear();
        ring.extend(vertices.iter().rev());
        halve(&mut ring, &mut caps);
    }
    caps
}

/// Closes a ring by cutting off every second vertex, then every second of the rest, until nothing is left.
///
/// The caps have no vertex of their own, so they lie on the lattice and inside the hull of their loop. Most
/// are as small as the loop's edges, each round halves the number and doubles the size: a fan's are all as
/// long as the loop is wide. A loop of three, such as that of an isolated facet, is its own reverse; a
/// T-junction in a straight edge needs no area.
fn halve(ring: &mut Vec<Units>, caps: &mut Vec<Triangle>) {
    while ring.len() >= 3 {
        let corners = ring.len();
        let cuts = if corners == 3 { 1 } else { corners / 2 };
        let corner = |i: usize| ring[i % corners];
        for cut in 0..cuts {
            caps.push([corner(2 * cut), corner(2 * cut + 1), corner(2 * cut + 2)]);
        }
        if corners == 3 {
            return;
        }
        let mut index = 0;
        ring.retain(|_| {
            index += 1;
            index % 2 == 1
        });
    }
}
