//! Snapped triangles as compact records, for soups that do not fit in memory.
//!
//! ```text
//! record:  tag u16 · the vertices that the two triangles before do not have
//! tag:     bits 0–2, 3–5, 6–8: where vertex 0, 1, 2 comes from: 0 new, 1 to 3 vertex 0 to 2 of the triangle
//!          before, 4 to 6 of the one before that; bits 9–10: width of the new vertices' coordinates
//! new:     three differences to the new vertex before, signed little-endian: of 1, 2 or 3 bytes, halved, or of
//!          4 bytes as they are
//! restart: tag 0xFFFF; what follows knows nothing of what came before
//! ```
//! A record takes at most 38 bytes, and at most 29 for what the snapper makes: even coordinates below 2^24. Swept
//! beads come as strips of quadrilaterals, in which a triangle has one vertex of its own: 8 bytes, where plain
//! integers are 36. The triangle before alone would know half of those.

use crate::lattice::{Triangle, Units};

/// A tag that no triangle has: there is no seventh known vertex.
const RESTART: u16 = 0xFFFF;

/// Codes triangles one after the other, in either direction.
#[derive(Default)]
struct Context {
    /// The vertices of the triangle before, then those of the one before that.
    known: [Units; 6],
    /// The new vertex before.
    vertex: Units,
}

/// Appends the records of `triangles`, such that what is packed one by one can be unpacked as one.
pub(super) fn pack<'a>(triangles: impl IntoIterator<Item = &'a Triangle>, out: &mut Vec<u8>) {
    let mut context = Context::default();
    out.extend_from_slice(&RESTART.to_le_bytes());
    for triangle in triangles {
        context.pack(triangle, out);
    }
}

/// Appends the triangles of `records`, which [`pack`] has made; `None` if they are something else.
pub(super) fn unpack(mut records: &[u8], out: &mut Vec<Triangle>) -> Option<()> {
    let mut context = Context::default();
    while let Some((tag, rest)) = records.split_first_chunk() {
        records = rest;
        let tag = u16::from_le_bytes(*tag);
        if tag == RESTART {
            context = Context::default();
            continue;
        }
        out.push(context.unpack(tag, &mut records)?);
    }
    records.is_empty().then_some(())
}

impl Context {
    fn pack(&mut self, triangle: &Triangle, out: &mut Vec<u8>) {
        let mut new = [0i32; 9];
        let mut count = 0;
        let mut tag = 0;
        for (n, vertex) in triangle.iter().enumerate() {
            match self.known.iter().position(|known| known == vertex) {
                Some(known) => tag |= (known as u16 + 1) << (3 * n),
                None => {
                    let before = std::mem::replace(&mut self.vertex, *vertex);
                    new[count..][..3].copy_from_slice(&[0, 1, 2].map(|a| vertex[a].wrapping_sub(before[a])));
                    count += 3;
                }
            }
        }
        self.remember(triangle);
        // Or-ing v ^ (v >> 31) keeps the highest bit of any magnitude, or-ing v the lowest.
        let (sizes, lows) =
            new[..count].iter().fold((0, 0), |(sizes, lows), &d| (sizes | (d ^ (d >> 31)), lows | d));
        let width = match sizes {
            _ if lows & 1 == 1 => 4,
            0..0x100 => 1,
            0x100..0x1_0000 => 2,
            0x1_0000..0x100_0000 => 3,
            _ => 4,
        };
        out.extend_from_slice(&(tag | (width as u16 - 1) << 9).to_le_bytes());
        for &d in &new[..count] {
            let stored = if width == 4 { d } else { d >> 1 };
            out.extend_from_slice(&stored.to_le_bytes()[..width]);
        }
    }

    fn unpack(&mut self, tag: u16, records: &mut &[u8]) -> Option<Triangle> {
        let width = usize::from(tag >> 9 & 3) + 1;
        let mut triangle = Triangle::default();
        for (n, vertex) in triangle.iter_mut().enumerate() {
            *vertex = match usize::from(tag >> (3 * n) & 7) {
                0 => {
                    let (bytes, rest) = records.split_at_checked(3 * width)?;
                    let differences = match records.first_chunk() {
                        Some(bytes) => differences(u128::from_le_bytes(*bytes), width),
                        None => {
                            let mut padded = [0; 16];
                            padded[..bytes.len()].copy_from_slice(bytes);
                            differences(u128::from_le_bytes(padded), width)
                        }
                    };
                    *records = rest;
                    self.vertex = [0, 1, 2].map(|a| self.vertex[a].wrapping_add(differences[a]));
                    self.vertex
                }
                known => *self.known.get(known - 1)?,
            };
        }
        self.remember(&triangle);
        Some(triangle)
    }

    fn remember(&mut self, triangle: &Triangle) {
        self.known.copy_within(..3, 3);
        self.known[..3].copy_from_slice(triangle);
    }
}

/// The three differences of some width that come first in memory. One load for all of them and no branch: widths change
/// from one vertex to the next.
#[inline]
fn differences(bytes: u128, width: usize) -> [i32; 3] {
    let unused = 32 - 8 * width as u32;
    let halved = u32::from(width < 4);
    [0, 1, 2].map(|a| {
        let stored = (bytes >> (8 * width * a)) as u32;
        ((stored << unused) as i32 >> unused) << halved
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Of a record of snapped vertices.
    const RECORD_BYTES_MAX: usize = 29;

    fn packed(triangles: &[Triangle]) -> Vec<u8> {
        let mut bytes = Vec::new();
        pack(triangles, &mut bytes);
        bytes
    }

    fn unpacked(bytes: &[u8]) -> Option<Vec<Triangle>> {
        let mut out = Vec::new();
        unpack(bytes, &mut out).map(|()| out)
    }

    #[test]
    fn a_strip_takes_one_vertex_a_triangle() {
        let (low, high) = (|n: i32| [200 * n, 0, 8 * n], |n: i32| [200 * n, 2000, 6 * n]);
        let cell = |n| [[low(n), low(n + 1), high(n + 1)], [low(n), high(n + 1), high(n)]];
        let strip: Vec<Triangle> = (0..100).flat_map(cell).collect();
        let bytes = packed(&strip);
        assert!(bytes.len() < 8 * strip.len() + 32, "{}", bytes.len());
        assert_eq!(unpacked(&bytes), Some(strip));
    }

    #[test]
    fn snapped_vertices_take_no_more_than_promised() {
        let far = (1 << 24) - 2;
        let wild = [[[0; 3], [far; 3], [2; 3]], [[far, 0, far], [0, far, 0], [far; 3]]];
        assert!(packed(&wild).len() <= 2 + 2 * RECORD_BYTES_MAX);
        assert_eq!(unpacked(&packed(&wild)), Some(wild.to_vec()));
    }

    proptest! {
        #[test]
        fn all_triangles_come_back(
            wild in prop::collection::vec(any::<Triangle>(), 0..40),
            near in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-3i32..3)), 0..40),
            scale in 1i32..70_000,
        ) {
            let near = near.iter().map(|t| t.map(|v| v.map(|c| 2 * c * scale)));
            let all: Vec<Triangle> = wild.into_iter().chain(near).collect();
            let (first, rest) = all.split_at(all.len() / 3);
            prop_assert_eq!(unpacked(&[packed(first), packed(rest)].concat()), Some(all));
        }

        #[test]
        fn any_bytes_give_triangles_or_nothing(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            if let Some(triangles) = unpacked(&bytes) {
                prop_assert!(triangles.len() <= bytes.len());
            }
        }
    }
}
