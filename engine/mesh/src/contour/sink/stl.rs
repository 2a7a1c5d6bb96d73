//! Binary STL: 80 bytes of header, a 32-bit count, then 50 bytes a facet. Positions are f32 and not shared.

use super::super::cut::Cuts;
use super::{MeshChunk, MeshEncoding, MeshSink, TriangleBytes, VertexBytes};
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

fn write_facets(cuts: &Cuts, bytes: &mut Vec<u8>) {
    // The last position's zero is the record's end and reaches into the next one, which is written later.
    const PAST: usize = 2;
    let mut end = bytes.len();
    bytes.resize(end + Cuts::MOST_FACETS * FACET_BYTES + PAST, 0);
    cuts.for_each(|_, [a, b, c], normal| {
        let Some(record) = bytes[end..].first_chunk_mut::<{ FACET_BYTES + PAST }>() else { return };
        for (n, vector) in [normal, a, b, c].into_iter().enumerate() {
            record[12 * n..12 * n + 16].copy_from_slice(vector.map(f32::to_le_bytes).as_flattened());
        }
        end += FACET_BYTES;
    });
    bytes.truncate(end);
}

impl MeshSink for StlSink {
    fn encoding(&self) -> Option<MeshEncoding> {
        Some(MeshEncoding {
            vertices: VertexBytes::Positions(|_, _| {}),
            triangles: TriangleBytes::Lone(write_facets),
        })
    }

    fn encoded(&mut self, part: MeshChunk<'_>) -> Result<()> {
        let MeshChunk::Triangles(count, bytes) = part else { return Ok(()) };
        let count = u32::try_from(count).ok().and_then(|n| self.count.checked_add(n));
        self.count = count.ok_or_else(|| {
            Error::setting(
                format!("{}: an STL file cannot hold more than 2^32 - 1 facets", self.file.path().display()),
                "write .ply or choose a coarser level with `level`",
            )
        })?;
        self.file.append(bytes)
    }

    fn finish(&mut self) -> Result<()> {
        self.file.overwrite(HEADER_BYTES as u64, &self.count.to_le_bytes())?;
        self.file.finish()
    }
}
