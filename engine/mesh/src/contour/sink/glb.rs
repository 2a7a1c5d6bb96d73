//! Binary glTF 2.0 (`.glb`): a header, a chunk of JSON, and a chunk of positions and indices (Khronos glTF 2.0, §4.4).
//!
//! Where vertices have normals, each stands behind its position: one view of the data with a stride serves two accessors.
//! Readers shade a mesh without normals flat (§3.7.2.1).
//!
//! glTF counts in metres and has y up; a matrix turns the part, which has z up, and scales it.

use super::arrays::write_triangles;
use super::ply::vertex_bytes;
use super::{MeshChunk, MeshEncoding, MeshSink, TriangleBytes, folder_of, triples};
use crate::error::{Error, Result};
use crate::part::PartFile;
use std::path::Path;

/// Room for the JSON, which is known at the end only and filled up with spaces. Most of it is nine numbers of up to 24
/// characters.
const JSON_BYTES: usize = 1024;
/// Header of the file, and of a chunk.
pub(in crate::contour) const HEAD_BYTES: usize = 12;
pub(in crate::contour) const CHUNK_BYTES: usize = 8;
/// Where the positions begin.
const DATA: u64 = (HEAD_BYTES + CHUNK_BYTES + JSON_BYTES + CHUNK_BYTES) as u64;
/// Bytes of a position, of a normal, and of the indices of a triangle.
pub(super) const TRIPLE_BYTES: u64 = 12;

/// A mesh as binary glTF, whose vertices may have normals, or a number of 32 bits each.
pub struct GlbSink {
    file: PartFile,
    vertices: u64,
    triangles: u64,
    /// Least and greatest coordinates.
    bounds: [[f32; 3]; 2],
    metres: f64,
    normals: bool,
    /// The attribute of the numbers, and how many of them there are.
    numbers: Option<(String, u64)>,
}

impl GlbSink {
    /// `metres` is the length of the unit of the positions, one if it is not known; vertices have normals if `normals` says
    /// so.
    pub(super) fn new(mut file: PartFile, metres: Option<f64>, normals: bool) -> Result<GlbSink> {
        file.append(&[0; DATA as usize - CHUNK_BYTES])?;
        let bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        let metres = metres.unwrap_or(1.0);
        Ok(GlbSink { file, vertices: 0, triangles: 0, bounds, metres, normals, numbers: None })
    }

    /// Vertices have a number each, as the attribute `_NAME`; they come when all triangles have come.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn with_numbers(file: PartFile, metres: Option<f64>, name: &str) -> Result<GlbSink> {
        let mut sink = GlbSink::new(file, metres, false)?;
        sink.numbers = Some((format!("_{}", name.to_ascii_uppercase()), 0));
        Ok(sink)
    }

    /// The numbers of the next vertices. glTF has no number for what is none (§3.6.2.2), which is written as -1.
    ///
    /// # Errors
    /// What writing gives.
    pub fn numbers(&mut self, numbers: &[f32]) -> Result<()> {
        let finite = numbers.iter().map(|number| if number.is_finite() { *number } else { -1.0 });
        let bytes: Vec<u8> = finite.flat_map(f32::to_le_bytes).collect();
        if let Some((_, count)) = &mut self.numbers {
            *count += numbers.len() as u64;
        }
        self.require_room()?;
        self.file.append(&bytes)
    }

    /// Refuses what is longer than the format can say.
    fn require_room(&self) -> Result<()> {
        require_glb_room(&self.file, JSON_BYTES, self.data_bytes())
    }

    /// From one vertex to the next.
    fn vertex_bytes(&self) -> u64 {
        if self.normals { 2 * TRIPLE_BYTES } else { TRIPLE_BYTES }
    }

    /// Bytes of the vertices, indices and numbers.
    fn data_bytes(&self) -> u64 {
        let numbers = self.numbers.as_ref().map_or(0, |(_, count)| 4 * count);
        self.vertex_bytes() * self.vertices + TRIPLE_BYTES * self.triangles + numbers
    }

    fn json(&self) -> String {
        if self.vertices == 0 {
            return empty_json();
        }
        // With an exponent, or small numbers would take a line of zeros.
        let [low, high] = self.bounds.map(|at| at.map(|c| format!("{:e}", f64::from(c))).join(","));
        let indices = 3 * self.triangles;
        let (vertices, indices_bytes) = (self.vertices, TRIPLE_BYTES * self.triangles);
        let (stride, vertices_bytes) = (self.vertex_bytes(), self.vertex_bytes() * vertices);
        let [mut attribute, mut accessor, mut view] = [const { String::new() }; 3];
        if self.normals {
            attribute = r#","NORMAL":2"#.to_owned();
            accessor = format!(
                r#",{{"bufferView":0,"byteOffset":{TRIPLE_BYTES},"componentType":5126,"count":{vertices},"type":"VEC3"}}"#
            );
            view = format!(r#","byteStride":{stride}"#);
        }
        let mut last_view = String::new();
        if let Some((name, count)) = &self.numbers {
            attribute = format!(r#","{name}":2"#);
            accessor = format!(r#",{{"bufferView":2,"componentType":5126,"count":{count},"type":"SCALAR"}}"#);
            let (from, bytes) = (vertices_bytes + indices_bytes, 4 * count);
            last_view = format!(r#",{{"buffer":0,"byteOffset":{from},"byteLength":{bytes},"target":34962}}"#);
        }
        [
            part_node(self.metres),
            format!(
                r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0{attribute}}},"indices":1}}]}}],"#
            ),
            format!(r#""accessors":[{{"bufferView":0,"componentType":5126,"count":{vertices},"#),
            format!(r#""type":"VEC3","min":[{low}],"max":[{high}]}},"#),
            format!(r#"{{"bufferView":1,"componentType":5125,"count":{indices},"type":"SCALAR"}}"#),
            format!(r#"{accessor}],"#),
            format!(r#""bufferViews":[{{"buffer":0,"byteLength":{vertices_bytes}{view},"target":34962}},"#),
            format!(r#"{{"buffer":0,"byteOffset":{vertices_bytes},"byteLength":{indices_bytes},"#),
            format!(r#""target":34963}}{last_view}],"buffers":[{{"byteLength":{}}}]}}"#, self.data_bytes()),
        ]
        .concat()
    }
}

impl MeshSink for GlbSink {
    fn encoding(&self) -> Option<MeshEncoding> {
        let vertices = vertex_bytes(self.normals);
        Some(MeshEncoding { vertices, triangles: TriangleBytes::Numbered(write_triangles) })
    }

    fn folder(&self) -> Option<&Path> {
        folder_of(self.file.path())
    }

    fn encoded(&mut self, part: MeshChunk<'_>) -> Result<()> {
        let (MeshChunk::Vertices(_, bytes) | MeshChunk::Triangles(_, bytes)) = part;
        if bytes.is_empty() {
            return Ok(());
        }
        // The first vertices begin the chunk.
        if self.vertices == 0 {
            self.file.append(&[0; CHUNK_BYTES])?;
        }
        // Between positions there are normals.
        let every = if self.normals { 2 } else { 1 };
        match part {
            MeshChunk::Vertices(count, _) => {
                self.vertices += count as u64;
                let [low, high] = &mut self.bounds;
                for position in triples(bytes, f32::from_le_bytes).step_by(every) {
                    *low = std::array::from_fn(|a| low[a].min(position[a]));
                    *high = std::array::from_fn(|a| high[a].max(position[a]));
                }
            }
            MeshChunk::Triangles(count, _) => self.triangles += count as u64,
        }
        self.require_room()?;
        self.file.append(bytes)
    }

    fn finish(&mut self) -> Result<()> {
        let data_bytes = if self.vertices == 0 { None } else { Some(self.data_bytes()) };
        self.file.overwrite(0, &glb_head(&self.json(), JSON_BYTES, data_bytes))?;
        self.file.finish()
    }
}

/// Who wrote a file.
pub(in crate::contour) const ASSET: &str = r#""asset":{"version":"2.0","generator":"Brickfield"},"scene":0"#;

/// The whole JSON of no mesh: glTF knows none without anything in it.
pub(super) fn empty_json() -> String {
    format!(r#"{{{ASSET},"scenes":[{{}}]}}"#)
}

/// The beginning of the JSON of a mesh with z up in units of so many metres: the node that turns and scales it.
pub(super) fn part_node(metres: f64) -> String {
    let start = format!(r#"{{{ASSET},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"#);
    format!(r#"{start}"matrix":[{metres:e},0,0,0,0,0,-{metres:e},0,0,{metres:e},0,0,0,0,0,1]}}],"#)
}

/// Refuses what is longer than the format can say, with so many bytes of JSON and of data.
pub(super) fn require_glb_room(file: &PartFile, json_bytes: usize, data_bytes: u64) -> Result<()> {
    if (HEAD_BYTES + 2 * CHUNK_BYTES + json_bytes) as u64 + data_bytes > u64::from(u32::MAX) {
        return Err(Error::setting(
            format!("{}: a GLB file cannot hold 4 GiB", file.path().display()),
            "write .ply or choose a coarser level with `level`",
        ));
    }
    Ok(())
}

/// All that stands before the data: JSON filled up to so many bytes, and the head of the second chunk if there is one. What is
/// longer than the format can say has been refused.
pub(in crate::contour) fn glb_head(json: &str, json_bytes: usize, data_bytes: Option<u64>) -> Vec<u8> {
    let chunk = data_bytes.map_or(0, |bytes| CHUNK_BYTES as u64 + bytes);
    let total = (HEAD_BYTES + CHUNK_BYTES + json_bytes) as u64 + chunk;
    let mut head = b"glTF".to_vec();
    for number in [2, total as u32, json_bytes as u32] {
        head.extend(number.to_le_bytes());
    }
    head.extend(b"JSON");
    head.extend(json.bytes());
    head.resize(HEAD_BYTES + CHUNK_BYTES + json_bytes, b' ');
    if let Some(bytes) = data_bytes {
        head.extend((bytes as u32).to_le_bytes());
        head.extend(b"BIN\0");
    }
    head
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::PartFile;

    #[test]
    fn the_longest_head_has_room() {
        let dir = tempfile::tempdir().unwrap();
        let file = PartFile::create(&dir.path().join("a.glb")).unwrap();
        // Numbers of the most digits, of the largest file.
        let mut sink = GlbSink::new(file, Some(-1.234_567_890_123_456_7e-300), true).unwrap();
        sink.bounds = [[-1.175_494_4e-38; 3]; 2];
        (sink.vertices, sink.triangles) = (100_000_000, 150_000_000);
        assert!(sink.json().len() <= JSON_BYTES, "{}", sink.json().len());
        let longest = "_DEVIATION_OF_SOME_LONGER_NAME".to_owned();
        (sink.normals, sink.numbers) = (false, Some((longest, 100_000_000)));
        assert!(sink.json().len() <= JSON_BYTES, "{}", sink.json().len());
    }
}
