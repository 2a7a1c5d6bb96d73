//! Inner nodes of a tree: which places have children, and the values of the others.

use super::cursor::Cursor;
use super::values::{Unpacker, ValueCoding, is_set};
use crate::error::Result;

/// The values of a node's places. Few nodes have many of them.
enum TileValues {
    One(f64),
    Few(Vec<f64>, Box<[u8]>),
    Many(Box<[f64]>),
}

impl TileValues {
    /// Of all places; those with a child do not count.
    fn of(values: &[f64], children: &[u8]) -> TileValues {
        let mut distinct: Vec<f64> = Vec::new();
        let mut places = vec![0u8; values.len()];
        let mut last = 0;
        for (n, &value) in values.iter().enumerate() {
            if is_set(children, n) {
                continue;
            }
            let is_it = |known: &f64| known.to_bits() == value.to_bits();
            if !distinct.get(last).is_some_and(is_it) {
                last = distinct.iter().position(is_it).unwrap_or(distinct.len());
            }
            if last == distinct.len() {
                if last > usize::from(u8::MAX) {
                    return TileValues::Many(values.into());
                }
                distinct.push(value);
            }
            places[n] = last as u8;
        }
        match distinct[..] {
            [] => TileValues::One(0.0),
            [value] => TileValues::One(value),
            _ => TileValues::Few(distinct, places.into()),
        }
    }

    fn at(&self, place: usize) -> f64 {
        match self {
            TileValues::One(value) => *value,
            TileValues::Few(distinct, places) => distinct[usize::from(places[place])],
            TileValues::Many(values) => values[place],
        }
    }
}

/// What a node has at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NodeEntry {
    /// One value.
    Tile(f64),
    /// The child of this number among all of its kind.
    Child(usize),
}

/// An inner node.
pub(super) struct InnerNode {
    /// 64 places each, and the children before them.
    children: Vec<(u64, u32)>,
    first_child: usize,
    tiles: TileValues,
}

impl InnerNode {
    /// Reads a node with 8 places for each of `mask_bytes`, whose first child will have a number.
    pub fn read(
        cursor: &mut Cursor<'_>,
        mask_bytes: usize,
        coding: ValueCoding,
        first_child: usize,
        unpacker: &mut Unpacker,
    ) -> Result<InnerNode> {
        let (children, active) = (cursor.take(mask_bytes)?, cursor.take(mask_bytes)?);
        let mut values = Vec::new();
        coding.read(active, cursor, unpacker, &mut values)?;
        let tiles = TileValues::of(&values, children);
        let mut before = 0;
        let words = children.as_chunks::<8>().0.iter().map(|&chunk| {
            let word = (u64::from_le_bytes(chunk), before);
            before += word.0.count_ones();
            word
        });
        Ok(InnerNode { children: words.collect(), first_child, tiles })
    }

    /// The places with children.
    pub fn places(&self) -> impl Iterator<Item = usize> {
        let is_child = |&place: &usize| self.children[place / 64].0 >> (place % 64) & 1 == 1;
        (0..64 * self.children.len()).filter(is_child)
    }

    /// What is at a place.
    pub fn at(&self, place: usize) -> NodeEntry {
        let (word, before) = self.children[place / 64];
        let bit = place % 64;
        if word >> bit & 1 == 0 {
            return NodeEntry::Tile(self.tiles.at(place));
        }
        let inside = (word & ((1 << bit) - 1)).count_ones();
        NodeEntry::Child(self.first_child + (before + inside) as usize)
    }

    /// All places that are not what `outside` is.
    pub fn reached(&self, outside: f64) -> impl Iterator<Item = usize> {
        (0..64 * self.children.len()).filter(move |&place| self.at(place) != NodeEntry::Tile(outside))
    }
}
