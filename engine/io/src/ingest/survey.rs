//! What a build must know of an input before it begins: its bounds, and what tells its content from any other. Both
//! take all of the file, and are found in one pass over it where the facets are read in place.

use super::bounds::FacetBounds;
use super::origin::{CHUNK_BYTES, hash_of_chunks};
use super::{Input, Soup, bounds_of, stl};
use crate::error::Result;
use crate::progress::Progress;
use rayon::prelude::*;

/// Bytes of a chunk that are hashed and then measured, while they are in the second cache.
const PART_BYTES: usize = 128 << 10;

/// Bounds and identity of an input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Survey {
    /// As [`Input::bounds`] gives them.
    pub bounds: ([f64; 3], [f64; 3]),
    /// As [`Input::identity`] gives it.
    pub identity: [u8; 32],
}

impl Survey {
    /// Lower and upper corner of the box around several inputs.
    pub fn bounds_of_all(surveys: &[Survey]) -> ([f64; 3], [f64; 3]) {
        bounds_of(surveys.iter().map(|survey| survey.bounds))
    }
}

impl Input {
    /// Bounds and identity, in one pass over a binary STL.
    ///
    /// # Errors
    /// As [`Input::bounds`].
    pub fn survey(&self, progress: &dyn Progress) -> Result<Survey> {
        if !matches!(self.soup, Soup::Mapped) || self.facets == 0 {
            return Ok(Survey { bounds: self.bounds(progress)?, identity: self.identity()? });
        }
        progress.phase("measuring", Some(self.facets), "triangles");
        let chunks = self.origin.bytes().chunks(CHUNK_BYTES).enumerate().par_bridge();
        let of_chunk = |(number, chunk)| {
            progress.check()?;
            let (hash, extent, facets) = self.survey_chunk(number * CHUNK_BYTES, chunk);
            progress.advance(facets);
            Ok(((number, hash), extent))
        };
        let (hashes, extents): (Vec<_>, Vec<_>) =
            chunks.map(of_chunk).collect::<Result<Vec<_>>>()?.into_iter().unzip();
        self.check()?;
        let extent = extents.into_iter().fold(FacetBounds::EMPTY, FacetBounds::union);
        let bounds = extent.corners().map_err(|facet| self.not_finite(facet))?;
        Ok(Survey { bounds, identity: hash_of_chunks(hashes) })
    }

    /// The hash of a chunk of a binary STL, which begins at byte `start`, and the extent of the facets that begin in
    /// it, with their number.
    fn survey_chunk(&self, start: usize, chunk: &[u8]) -> ([u8; 32], FacetBounds, u64) {
        let bytes = self.origin.bytes();
        let mut hasher = blake3::Hasher::new();
        let (mut extent, mut facets) = (FacetBounds::EMPTY, 0);
        let mut from = start;
        for part in chunk.chunks(PART_BYTES) {
            hasher.update(part);
            let to = from + part.len();
            let [first, end] = [from, to].map(|byte| stl::facets_before(byte).min(self.facets as usize));
            if first < end {
                let part = stl::extent(stl::records(bytes, first, end));
                extent = extent.union(part.counted_from(first as u64));
                facets += (end - first) as u64;
            }
            from = to;
        }
        (*hasher.finalize().as_bytes(), extent, facets)
    }

    /// Tells the content of the file from any other, to recognise the source of a store: the BLAKE3 hash of
    /// the concatenated BLAKE3 hashes of its 4 MiB chunks in order, the last one being shorter. Reads the
    /// whole file on all threads. Of arrays in memory, the BLAKE3 hash of their numbers, little-endian.
    ///
    /// # Errors
    /// If the file has been cut short or changed since it was opened.
    pub fn identity(&self) -> Result<[u8; 32]> {
        self.origin.identity()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;

    /// A binary STL whose facets lie across the borders of parts and chunks, the last of them with a corner at `x`.
    fn stl(facets: u32, x: f32) -> Vec<u8> {
        let mut bytes = vec![7; 80];
        bytes.extend(facets.to_le_bytes());
        for number in 0..facets {
            let far = if number + 1 == facets { x } else { number as f32 };
            let corners = [[0.0; 3], [far, -2.0, 0.5], [1.0, 3.0, number as f32 * 1e-3], [-1.0, 0.0, 0.0]];
            bytes.extend(corners.as_flattened().iter().flat_map(|c| c.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[test]
    fn one_pass_finds_what_two_do() {
        let folder = tempfile::tempdir().unwrap();
        let open = |facets, x| {
            let path = folder.path().join(format!("{facets} {x}.stl"));
            std::fs::write(&path, stl(facets, x)).unwrap();
            Input::open(&path, &Silent).unwrap()
        };
        // More than a chunk, not much more than a part, and a part that holds no beginning of a facet.
        let part = (PART_BYTES - 84) as u32 / 50;
        for facets in [90_000, part, part + 1, 1] {
            let input = open(facets, 1e6);
            let survey = input.survey(&Silent).unwrap();
            assert_eq!(survey.bounds, input.bounds(&Silent).unwrap());
            assert_eq!(survey.identity, input.identity().unwrap());
            assert_eq!(survey.bounds.1[0], 1e6);
        }
        let refused = open(90_001, f32::NAN);
        let [one, two] = [refused.survey(&Silent).unwrap_err(), refused.bounds(&Silent).unwrap_err()];
        assert!(one.to_string().contains("facet 90001") && one.to_string() == two.to_string(), "{one}");
        assert!(open(0, 0.0).survey(&Silent).is_err());
    }
}
