//! Where tiles lie, which there are, and what they are called: `tileset.json` and the files of availability.
//!
//! A *subtree* is some levels below a node: a bit a node for whether it is a tile, one for whether it has a file, and one for each
//! place below the last level for whether a subtree goes on there.

use crate::lattice::{BRICK_CELLS, NodeKey, RootCube};
use std::collections::BTreeSet;

/// Folders of tiles and of their availability.
pub(super) const CONTENT: &str = "content";
pub(super) const SUBTREES: &str = "subtrees";
/// Most levels of a subtree that is the only one, and levels of each where there are several.
const LONE_LEVELS: u8 = 5;
const SUBTREE_LEVELS: u8 = 4;

/// The cubes of nodes, around the origin, and where that is.
pub(super) struct TileGrid {
    /// Lowest corner and edge of the root's cells.
    low: [f64; 3],
    edge: f64,
    middle: [f64; 3],
    metres: f64,
}

impl TileGrid {
    /// Of a root cube that was moved by its middle.
    pub fn new(root: RootCube, middle: [f64; 3], metres: f64) -> TileGrid {
        // Cells lie between samples, which are a unit off.
        TileGrid { low: root.to_world([1.0; 3]), edge: root.edge, middle, metres }
    }

    /// The node of a level that the middle of a triangle lies in.
    pub fn node_at(&self, level: u8, corners: [[f32; 3]; 3]) -> NodeKey {
        let count = 1u32 << level;
        let position = std::array::from_fn(|a| {
            let sum: f64 = corners.iter().map(|corner| f64::from(corner[a])).sum();
            let at = ((sum / 3.0 - self.low[a]) / self.edge * f64::from(count)).floor();
            (at.max(0.0) as u32).min(count - 1)
        });
        NodeKey::new(level, position).unwrap_or(NodeKey::ROOT)
    }

    /// The file that programs open.
    pub fn tileset(&self, contents: &BTreeSet<NodeKey>) -> String {
        let levels = levels_of(contents);
        let edge = self.edge * self.metres;
        // A cell of a level is how far its mesh may be from the part.
        let error = edge / BRICK_CELLS as f64;
        let numbers =
            |numbers: &[f64]| numbers.iter().map(|c| format!("{c:e}")).collect::<Vec<_>>().join(",");
        let [x, y, z] = self.low.map(|c| (c + self.edge / 2.0) * self.metres);
        let half = edge / 2.0;
        let region = numbers(&[x, y, z, half, 0.0, 0.0, 0.0, half, 0.0, 0.0, 0.0, half]);
        let [x, y, z] = self.middle.map(|c| c * self.metres);
        let matrix = numbers(&[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0]);
        let subtree_levels = subtree_levels(levels);
        let place = "{level}/{x}/{y}/{z}";
        format!(
            r#"{{
  "asset": {{ "version": "1.1" }},
  "geometricError": {edge:e},
  "root": {{
    "boundingVolume": {{ "box": [{region}] }},
    "transform": [{matrix}],
    "geometricError": {error:e},
    "refine": "REPLACE",
    "content": {{ "uri": "{CONTENT}/{place}.glb" }},
    "implicitTiling": {{
      "subdivisionScheme": "OCTREE",
      "subtreeLevels": {subtree_levels},
      "availableLevels": {levels},
      "subtrees": {{ "uri": "{SUBTREES}/{place}.subtree" }}
    }}
  }}
}}
"#
        )
    }

    /// The files of availability, each with the node at its top.
    pub fn subtrees(&self, contents: &BTreeSet<NodeKey>) -> Vec<(NodeKey, Vec<u8>)> {
        let levels = levels_of(contents);
        // A tile's parents are tiles, with a file or not.
        let ancestors =
            |key: &NodeKey| (0..=key.level()).filter_map(|level| key.ancestor(level)).collect::<Vec<_>>();
        let mut tiles: BTreeSet<NodeKey> = contents.iter().flat_map(ancestors).collect();
        tiles.insert(NodeKey::ROOT);
        let step = subtree_levels(levels);
        let tops = tiles.iter().filter(|key| key.level().is_multiple_of(step));
        tops.map(|top| (*top, subtree(*top, step, &tiles, contents))).collect()
    }
}

/// Levels that have tiles; one at least.
fn levels_of(contents: &BTreeSet<NodeKey>) -> u8 {
    contents.last().map_or(0, |key| key.level()) + 1
}

fn subtree_levels(levels: u8) -> u8 {
    if levels <= LONE_LEVELS { levels } else { SUBTREE_LEVELS }
}

/// A bit for each place.
struct Bits {
    bytes: Vec<u8>,
    count: usize,
    len: usize,
}

impl Bits {
    fn new(len: usize) -> Bits {
        Bits { bytes: vec![0; len.div_ceil(8)], count: 0, len }
    }

    fn set(&mut self, place: usize) {
        self.bytes[place / 8] |= 1 << (place % 8);
        self.count += 1;
    }
}

fn subtree(top: NodeKey, levels: u8, tiles: &BTreeSet<NodeKey>, contents: &BTreeSet<NodeKey>) -> Vec<u8> {
    let first = |level: u8| ((1usize << (3 * level)) - 1) / 7;
    // Nodes of a level below `top` follow each other.
    let below = |of: &BTreeSet<NodeKey>, level: u8| -> Vec<usize> {
        let start = top.code() << (3 * level);
        let end = start + ((1 << (3 * level)) - 1);
        let range = NodeKey::from_code(start).zip(NodeKey::from_code(end));
        range.map_or(Vec::new(), |(start, end)| {
            of.range(start..=end).map(|key| (key.code() - start.code()) as usize).collect()
        })
    };
    let [mut is_tile, mut has_file] = [tiles, contents].map(|of| {
        let mut bits = Bits::new(first(levels));
        for level in 0..levels {
            below(of, level).into_iter().for_each(|place| bits.set(first(level) + place));
        }
        bits
    });
    let mut goes_on = Bits::new(1 << (3 * levels));
    below(tiles, levels).into_iter().for_each(|place| goes_on.set(place));
    subtree_bytes([&mut is_tile, &mut has_file, &mut goes_on])
}

/// Header, JSON and bits, the latter two to multiples of eight bytes.
fn subtree_bytes(bits: [&mut Bits; 3]) -> Vec<u8> {
    let (mut data, mut views, mut said) = (Vec::new(), Vec::new(), Vec::new());
    for bits in bits {
        if bits.count == 0 || bits.count == bits.len {
            said.push(format!(r#"{{"constant":{}}}"#, u8::from(bits.count > 0)));
            continue;
        }
        said.push(format!(r#"{{"bitstream":{},"availableCount":{}}}"#, views.len(), bits.count));
        views.push(format!(
            r#"{{"buffer":0,"byteOffset":{},"byteLength":{}}}"#,
            data.len(),
            bits.bytes.len()
        ));
        data.append(&mut bits.bytes);
        data.resize(data.len().next_multiple_of(8), 0);
    }
    let [tiles, files, below] = [0, 1, 2].map(|n| &said[n]);
    let mut json = r#"{"#.to_owned();
    if !views.is_empty() {
        json +=
            &format!(r#""buffers":[{{"byteLength":{}}}],"bufferViews":[{}],"#, data.len(), views.join(","));
    }
    json += &format!(
        r#""tileAvailability":{tiles},"contentAvailability":[{files}],"childSubtreeAvailability":{below}}}"#
    );
    let mut json = json.into_bytes();
    json.resize(json.len().next_multiple_of(8), b' ');
    let mut bytes = b"subt".to_vec();
    bytes.extend(1u32.to_le_bytes());
    bytes.extend((json.len() as u64).to_le_bytes());
    bytes.extend((data.len() as u64).to_le_bytes());
    bytes.extend(json);
    bytes.extend(data);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deep_trees_have_subtrees_below_subtrees() {
        let root = RootCube { origin: [-1.0; 3], edge: 2.0 };
        let grid = TileGrid::new(root, [0.0; 3], 1.0);
        let deep = |level: u8, at: [u32; 3]| NodeKey::new(level, at).unwrap();
        // A level without a file is between.
        let contents: BTreeSet<NodeKey> =
            [deep(0, [0; 3]), deep(6, [63, 0, 1]), deep(6, [62, 0, 1])].into_iter().collect();
        let subtrees = grid.subtrees(&contents);
        assert_eq!(
            subtrees.iter().map(|(key, _)| *key).collect::<Vec<_>>(),
            [deep(0, [0; 3]), deep(4, [15, 0, 0])]
        );
        let json = |bytes: &[u8]| -> serde_json::Value {
            let end = 24 + u64::from_le_bytes(bytes[8..16].try_into().unwrap()) as usize;
            serde_json::from_slice(&bytes[24..end]).unwrap()
        };
        let [top, below] = [0, 1].map(|n| json(&subtrees[n].1));
        // Levels 0 to 3 and 4 to 6: one tile each but the last.
        assert_eq!(
            (&top["tileAvailability"]["availableCount"], &top["contentAvailability"][0]["availableCount"]),
            (&4.into(), &1.into())
        );
        assert_eq!(top["childSubtreeAvailability"]["availableCount"], 1);
        assert_eq!(
            (
                &below["tileAvailability"]["availableCount"],
                &below["contentAvailability"][0]["availableCount"]
            ),
            (&4.into(), &2.into())
        );
        assert_eq!(below["childSubtreeAvailability"]["constant"], 0);
        // Place 15, 0, 0 of level 4: every x bit, that is 0b001001001001.
        let data = &subtrees[0].1;
        let bits = &data[data.len() - 512..];
        assert_eq!(
            (bits[0b001_001_001_001 / 8], bits.iter().map(|b| b.count_ones()).sum::<u32>()),
            (1 << 1, 1)
        );
        assert!(
            grid.tileset(&contents).contains("\"availableLevels\": 7")
                && grid.tileset(&contents).contains("\"subtreeLevels\": 4")
        );
    }

    #[test]
    fn nothing_at_all_is_a_tile_without_a_file() {
        let grid = TileGrid::new(RootCube { origin: [0.0; 3], edge: 1.0 }, [0.0; 3], 1.0);
        let subtrees = grid.subtrees(&BTreeSet::new());
        assert_eq!(subtrees.len(), 1);
        let text = String::from_utf8_lossy(&subtrees[0].1).into_owned();
        assert!(
            text.contains(r#""tileAvailability":{"constant":1},"contentAvailability":[{"constant":0}]"#),
            "{text}"
        );
    }
}
