//! Binary STL: 80 bytes of header, a 32-bit count, then 50 bytes a facet. Positions are f32 and not shared.

use super::super::polygons::Facet;
use super::{Encoded, Encoding, MeshSink};
use crate::error::{Error, Result};
use crate::part::PartFile;

const HEADER_BYTES: usize = 80;
const FACET_BYTES: usize = 50;
const TITLE: &[u8] = b"binary STL, written by Brickfield";

pub(super) struct StlSink {
    file: PartFile,
    count: u32,
}

impl StlSink {
    pub(super) fn new(mut file: PartFile) -> Result<StlSink> {
        // Readers take a file that starts with "solid" for the text form.
        let mut header = [b' '; HEADER_BYTES + 4];
        header[..TITLE.len()].copy_from_slice(TITLE);
        header[HEADER_BYTES..].fill(0);
        file.append(&header)?;
        Ok(StlSink { file, count: 0 })
    }
}

fn write_facets(facets: &[Facet], normals: &[[f32; 3]], bytes: &mut Vec<u8>) {
    let start = bytes.len();
    bytes.resize(start + facets.len() * FACET_BYTES, 0);
    let records = bytes[start..].as_chunks_mut::<FACET_BYTES>().0;
    for ((facet, normal), record) in facets.iter().zip(normals).zip(records) {
        let values = [*normal, facet.corners[0], facet.corners[1], facet.corners[2]];
        for (to, value) in record.as_chunks_mut::<4>().0.iter_mut().zip(values.as_flattened()) {
            *to = value.to_le_bytes();
        }
    }
}

impl MeshSink for StlSink {
    fn shares_vertices(&self) -> bool {
        false
    }

    fn encoding(&self) -> Option<Encoding> {
        Some(Encoding { vertices: |_, _| {}, facets: write_facets })
    }

    fn encoded(&mut self, part: Encoded<'_>) -> Result<()> {
        let Encoded::Triangles(count, bytes) = part else { return Ok(()) };
        let count = u32::try_from(count).ok().and_then(|n| self.count.checked_add(n));
        self.count = count.ok_or_else(|| {
            Error::setting(
                format!("{}: an STL file cannot hold more than 2^32 - 1 facets", self.file.path().display()),
                "write .ply or choose a coarser level with --level",
            )
        })?;
        self.file.append(bytes)
    }

    fn finish(&mut self) -> Result<()> {
        self.file.overwrite(HEADER_BYTES as u64, &self.count.to_le_bytes())?;
        self.file.finish()
    }
}
