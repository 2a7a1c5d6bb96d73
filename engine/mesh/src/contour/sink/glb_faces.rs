//! Binary glTF whose triangles have numbers. glTF has attributes of vertices alone, so each triangle has vertices of its own, three
//! with the same numbers, and no indices (Khronos glTF 2.0, §3.7.2).

use super::glb::{CHUNK_BYTES, HEAD_BYTES, TRIPLE_BYTES, empty_json, glb_head, part_node, require_glb_room};
use super::vtp::WaitingNumbers;
use super::{FaceAttributes, MeshSink, folder_of};
use crate::contour::cut::MeshTriangle;
use crate::contour::frame::united;
use crate::error::Result;
use crate::part::PartFile;
use std::path::Path;

/// Corners of a triangle.
const CORNERS: u64 = 3;
/// Room for the JSON beside what is said of attributes: numbers are known at the end only.
const JSON_BYTES: usize = 1024;
/// Room for what is said of an attribute beside its name.
const ATTRIBUTE_BYTES: usize = 160;

/// A mesh as binary glTF with the attributes `_BEAD`, `_LAYER` and so on, floats; what is to be said of them stands in the mesh's
/// `extras`.
pub struct GlbFacesSink<'a> {
    file: PartFile,
    faces: Box<dyn FaceAttributes + 'a>,
    /// Numbers of triangles, which stand behind all positions.
    waiting: WaitingNumbers,
    triangles: u64,
    bounds: Option<[[f32; 3]; 2]>,
    metres: f64,
    /// Bytes for the JSON.
    room: usize,
}

impl<'a> GlbFacesSink<'a> {
    /// `metres` is the length of the unit of the positions, one if it is not known.
    ///
    /// # Errors
    /// If the file cannot be made.
    pub fn create(
        path: &Path,
        metres: Option<f64>,
        faces: Box<dyn FaceAttributes + 'a>,
    ) -> Result<GlbFacesSink<'a>> {
        let names = faces.names();
        let of_names: usize = names.iter().map(|name| 2 * name.len() + ATTRIBUTE_BYTES).sum();
        let of_comments: usize = faces.comments().iter().map(|line| format!("{line:?},").len()).sum();
        let room = (JSON_BYTES + of_names + of_comments).next_multiple_of(4);
        let mut file = PartFile::create(path)?;
        file.append(&vec![0; HEAD_BYTES + CHUNK_BYTES + room])?;
        let waiting = WaitingNumbers::new(names.len(), folder_of(path));
        let metres = metres.unwrap_or(1.0);
        Ok(GlbFacesSink { file, faces, waiting, triangles: 0, bounds: None, metres, room })
    }

    /// Bytes of positions, and of the numbers of one attribute.
    fn part_bytes(&self) -> [u64; 2] {
        [CORNERS * TRIPLE_BYTES * self.triangles, CORNERS * 4 * self.triangles]
    }

    fn data_bytes(&self) -> u64 {
        let [positions, numbers] = self.part_bytes();
        positions + numbers * self.faces.names().len() as u64
    }

    fn json(&self) -> String {
        let Some(bounds) = self.bounds else { return empty_json() };
        let [low, high] = bounds.map(|at| at.map(|c| format!("{:e}", f64::from(c))).join(","));
        let count = CORNERS * self.triangles;
        let [positions, numbers] = self.part_bytes();
        let [mut attributes, mut accessors, mut views] = [const { String::new() }; 3];
        for (n, name) in self.faces.names().iter().enumerate() {
            let view = n + 1;
            attributes += &format!(r#","_{}":{view}"#, name.to_ascii_uppercase());
            accessors +=
                &format!(r#",{{"bufferView":{view},"componentType":5126,"count":{count},"type":"SCALAR"}}"#);
            let from = positions + numbers * n as u64;
            views += &format!(r#",{{"buffer":0,"byteOffset":{from},"byteLength":{numbers},"target":34962}}"#);
        }
        // Comments are of ASCII, whose escapes in Rust are those of JSON.
        let comments: Vec<String> = self.faces.comments().iter().map(|line| format!("{line:?}")).collect();
        let extras = match comments.is_empty() {
            true => String::new(),
            false => format!(r#","extras":{{"comments":[{}]}}"#, comments.join(",")),
        };
        [
            part_node(self.metres),
            format!(
                r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":0{attributes}}}}}]{extras}}}],"#
            ),
            format!(r#""accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"#),
            format!(r#""type":"VEC3","min":[{low}],"max":[{high}]}}{accessors}],"#),
            format!(r#""bufferViews":[{{"buffer":0,"byteLength":{positions},"target":34962}}{views}],"#),
            format!(r#""buffers":[{{"byteLength":{}}}]}}"#, self.data_bytes()),
        ]
        .concat()
    }
}

impl MeshSink for GlbFacesSink<'_> {
    fn shares_vertices(&self) -> bool {
        false
    }

    fn folder(&self) -> Option<&Path> {
        folder_of(self.file.path())
    }

    fn triangles(&mut self, facets: &[MeshTriangle]) -> Result<()> {
        if facets.is_empty() {
            return Ok(());
        }
        // The first triangles begin the chunk.
        if self.triangles == 0 {
            self.file.append(&[0; CHUNK_BYTES])?;
        }
        self.waiting.push(&self.faces.numbers(facets)?)?;
        self.triangles += facets.len() as u64;
        let mut bytes = Vec::with_capacity(facets.len() * (CORNERS * TRIPLE_BYTES) as usize);
        for corner in facets.iter().flat_map(|facet| &facet.corners) {
            self.bounds = Some(united(self.bounds.unwrap_or([*corner; 2]), [*corner; 2]));
            bytes.extend(corner.map(f32::to_le_bytes).as_flattened());
        }
        require_glb_room(&self.file, self.room, self.data_bytes())?;
        self.file.append(&bytes)
    }

    fn finish(&mut self) -> Result<()> {
        let file = &mut self.file;
        self.waiting.each(|_, bytes| {
            let numbers = bytes.as_chunks::<4>().0.iter().map(|bytes| i32::from_le_bytes(*bytes) as f32);
            let of_corners = numbers.flat_map(|number| [number; CORNERS as usize]);
            file.append(&of_corners.flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
        })?;
        let data_bytes = if self.triangles == 0 { None } else { Some(self.data_bytes()) };
        let head = glb_head(&self.json(), self.room, data_bytes);
        self.file.overwrite(0, &head)?;
        self.file.finish()
    }
}
