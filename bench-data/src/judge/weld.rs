//! Makes an indexed mesh of a facet soup.

use crate::StlFacet;

const EMPTY: u32 = u32::MAX;

/// Welds corners with the same f32 bits (and −0 with +0) into vertices, numbered by first appearance.
///
/// One open-addressing table of indices: a few bytes a vertex beside the result, one pass.
pub fn weld(facets: &[StlFacet]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    // Closed meshes have half as many vertices as facets; the table grows if there are more.
    let mut table = Table::with_room(facets.len() / 2 + 16);
    let triangles = facets.iter().map(|f| f.map(|corner| table.index(corner.map(bits)))).collect();
    let vertices = table.keys.into_iter().map(|k| k.map(|b| f64::from(f32::from_bits(b)))).collect();
    (vertices, triangles)
}

fn bits(v: f32) -> u32 {
    // Adding +0 turns −0 into +0 and changes nothing else.
    (v + 0.0).to_bits()
}

struct Table {
    slots: Vec<u32>,
    keys: Vec<[u32; 3]>,
}

impl Table {
    fn with_room(keys: usize) -> Table {
        Table { slots: vec![EMPTY; (keys * 2).next_power_of_two()], keys: Vec::with_capacity(keys) }
    }

    fn index(&mut self, key: [u32; 3]) -> u32 {
        let at = self.slot(key);
        if self.slots[at] != EMPTY {
            return self.slots[at];
        }
        let index = self.keys.len() as u32;
        self.slots[at] = index;
        self.keys.push(key);
        if self.keys.len() * 2 > self.slots.len() {
            self.grow();
        }
        index
    }

    /// The slot that holds `key`, or the empty one where it belongs.
    fn slot(&self, key: [u32; 3]) -> usize {
        let mask = self.slots.len() - 1;
        let mut at = hash(key) as usize & mask;
        while self.slots[at] != EMPTY && self.keys[self.slots[at] as usize] != key {
            at = (at + 1) & mask;
        }
        at
    }

    fn grow(&mut self) {
        self.slots = vec![EMPTY; self.slots.len() * 2];
        for index in 0..self.keys.len() {
            let at = self.slot(self.keys[index]);
            self.slots[at] = index as u32;
        }
    }
}

fn hash([x, y, z]: [u32; 3]) -> u64 {
    let mixed = (u64::from(x) | u64::from(y) << 32) ^ u64::from(z).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ mixed >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93);
    mixed ^ mixed >> 32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn welds_by_bits() {
        let near = f32::from_bits(1.0f32.to_bits() + 1);
        let facets = [[[0.0, -0.0, 1.0], [1.0; 3], [near, 1.0, 1.0]], [[-0.0, 0.0, 1.0], [1.0; 3], [2.0; 3]]];
        let (vertices, triangles) = weld(&facets);
        assert_eq!(triangles, [[0, 1, 2], [0, 1, 3]]);
        assert_eq!(vertices.len(), 4);
        assert_eq!(vertices[2], [f64::from(near), 1.0, 1.0]);
        // Enough distinct corners for the table to grow several times.
        let many: Vec<StlFacet> =
            (0..500).map(|i| [0, 1, 2].map(|c| [(3 * i + c) as f32, 0.5, 0.0])).collect();
        assert_eq!(weld(&many).0.len(), 1500);
    }
}
