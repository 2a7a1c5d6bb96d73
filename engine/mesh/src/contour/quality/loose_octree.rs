//! Triangles by place, in a loose octree that changes with the mesh (Ulrich 2000, *Loose Octrees*).

use super::super::adaptive::Bounds;

/// Levels below the root.
const DEEPEST: u32 = 20;
/// Margin of boxes against rounding, as a share of the root.
const MARGIN: f64 = 1e-12;
/// No child.
const NONE: u32 = 0;

/// Numbers of triangles. Each is in the node that its lower corner lies in, of the deepest level whose cubes are as wide as its
/// box: so it lies within that cube made twice as wide.
pub(super) struct LooseOctree {
    low: [f64; 3],
    size: f64,
    nodes: Vec<LooseNode>,
}

#[derive(Default)]
struct LooseNode {
    /// 0 where there is none: the root is nobody's child.
    children: [u32; 8],
    /// Triangles here and below.
    below: u32,
    triangles: Vec<u32>,
}

/// A node's level and its cube among those of the level.
#[derive(Clone, Copy)]
struct Cube {
    level: u32,
    at: [u32; 3],
}

impl LooseOctree {
    /// An empty one for what lies in a box.
    pub(super) fn new([low, high]: &Bounds) -> LooseOctree {
        let size = (0..3).map(|a| f64::from(high[a]) - f64::from(low[a])).fold(f64::MIN_POSITIVE, f64::max);
        LooseOctree { low: low.map(f64::from), size, nodes: vec![LooseNode::default()] }
    }

    /// Adds a triangle with these bounds.
    pub(super) fn add(&mut self, triangle: u32, bounds: &Bounds) {
        let cube = self.cube_of(bounds);
        let mut node = 0;
        self.nodes[0].below += 1;
        for level in 1..=cube.level {
            let octant = octant(cube, level);
            let mut child = self.nodes[node].children[octant];
            if child == NONE {
                child = self.nodes.len() as u32;
                self.nodes[node].children[octant] = child;
                self.nodes.push(LooseNode::default());
            }
            node = child as usize;
            self.nodes[node].below += 1;
        }
        self.nodes[node].triangles.push(triangle);
    }

    /// Removes a triangle that was added with these bounds.
    pub(super) fn remove(&mut self, triangle: u32, bounds: &Bounds) {
        let cube = self.cube_of(bounds);
        let mut node = 0;
        self.nodes[0].below -= 1;
        for level in 1..=cube.level {
            node = self.nodes[node].children[octant(cube, level)] as usize;
            self.nodes[node].below -= 1;
        }
        let triangles = &mut self.nodes[node].triangles;
        let at = triangles.iter().position(|&other| other == triangle);
        at.map(|at| triangles.swap_remove(at));
    }

    /// Whether `is_wanted` holds for a triangle whose cube meets a box; it is asked until it says so.
    pub(super) fn any(&self, bounds: &Bounds, mut is_wanted: impl FnMut(u32) -> bool) -> bool {
        let mut stack = vec![(0, Cube { level: 0, at: [0; 3] })];
        while let Some((node, cube)) = stack.pop() {
            let LooseNode { children, below, triangles } = &self.nodes[node];
            if *below == 0 || !self.meets(cube, bounds) {
                continue;
            }
            if triangles.iter().any(|&triangle| is_wanted(triangle)) {
                return true;
            }
            for (n, &child) in children.iter().enumerate().filter(|(_, child)| **child != NONE) {
                let at = [0, 1, 2].map(|a| 2 * cube.at[a] + (n as u32 >> a & 1));
                stack.push((child as usize, Cube { level: cube.level + 1, at }));
            }
        }
        false
    }

    fn cube_of(&self, [low, high]: &Bounds) -> Cube {
        let extent = (0..3).map(|a| f64::from(high[a]) - f64::from(low[a])).fold(0.0, f64::max);
        let mut level = 0;
        while level < DEEPEST && self.size / f64::from(1u32 << (level + 1)) >= extent {
            level += 1;
        }
        let cubes = f64::from(1u32 << level);
        // What moved beyond the root's box stays with the cubes at its border, which reach as far as anything moves.
        let along = |a: usize| (f64::from(low[a]) - self.low[a]) / self.size * cubes;
        Cube { level, at: [0, 1, 2].map(|a| along(a).floor().clamp(0.0, cubes - 1.0) as u32) }
    }

    /// Whether a node's cube, twice as wide, meets a box. Cubes at the root's border reach beyond it.
    fn meets(&self, cube: Cube, [low, high]: &Bounds) -> bool {
        let last = (1u32 << cube.level) - 1;
        let size = self.size / f64::from(1u32 << cube.level);
        let margin = MARGIN * self.size;
        (0..3).all(|a| {
            let from = self.low[a] + f64::from(cube.at[a]) * size - margin;
            let to = from + 2.0 * (size + margin);
            (cube.at[a] == last || f64::from(low[a]) <= to) && (cube.at[a] == 0 || f64::from(high[a]) >= from)
        })
    }
}

/// Which child of its parent a cube's ancestor of this level is.
fn octant(cube: Cube, level: u32) -> usize {
    let up = cube.level - level;
    (0..3).map(|a| ((cube.at[a] >> up & 1) as usize) << a).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contour::adaptive::meets;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_meets_a_box_is_asked_for(
            boxes in prop::collection::vec((prop::array::uniform3(-20i16..20), prop::array::uniform3(0i16..9)), 1..60),
            lost in prop::collection::vec(any::<bool>(), 60),
        ) {
            let of = |(low, size): &([i16; 3], [i16; 3])| -> Bounds {
                let low = low.map(|c| f32::from(c) / 4.0);
                [low, [0, 1, 2].map(|a| low[a] + f32::from(size[a]) / 3.0)]
            };
            let boxes: Vec<Bounds> = boxes.iter().map(of).collect();
            // Some reach beyond.
            let mut tree = LooseOctree::new(&[[-4.0; 3], [4.0; 3]]);
            (0..).zip(&boxes).for_each(|(n, own)| tree.add(n, own));
            let is_left = |n: &usize| !lost[*n];
            (0..boxes.len()).filter(|n| !is_left(n)).for_each(|n| tree.remove(n as u32, &boxes[n]));
            for own in &boxes {
                let mut asked = Vec::new();
                tree.any(own, |n| { asked.push(n as usize); false });
                asked.sort_unstable();
                prop_assert!(asked.iter().all(is_left));
                prop_assert!(asked.windows(2).all(|two| two[0] < two[1]));
                let met = (0..boxes.len()).filter(|n| is_left(n) && meets(&boxes[*n], own));
                for n in met {
                    prop_assert!(asked.binary_search(&n).is_ok());
                }
            }
        }
    }
}
