//! Binary glTF 2.0 (`.glb`; Khronos glTF 2.0, §3 and §4.4), in millimetres with z up.
//!
//! glTF counts in metres with y up. The meshes of a scene stand where its nodes place them. Points and lines bound
//! nothing and are passed over. Compressed meshes, and buffers in other files, are refused.

use super::placement::{Placement, SceneLimit};
use super::polygons::Polygons;
use crate::error::{Error, Result};
use crate::progress::Progress;
use serde_json::Value;
use std::path::Path;

const REMEDY: &str = "export it as .glb without compression, or as STL, OBJ or PLY";
/// How deep nodes of nodes go at most.
const DEPTH_MAX: usize = 256;
/// What can be put into `extensionsRequired` and does not change where surfaces are.
const HARMLESS: [&str; 3] = ["KHR_materials", "KHR_texture", "EXT_texture"];

/// Whether a file begins as a `.glb` does.
pub(super) fn is_glb(start: &[u8]) -> bool {
    start.starts_with(b"glTF")
}

/// Reads the meshes of the file's scene.
///
/// # Errors
/// If a chunk, accessor or node contradicts the file or itself, or needs what is not read; if the user interrupts.
pub(super) fn read(path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<Polygons> {
    let damaged = |what: String| Error::input(path, "glTF", super::text::plain(what.as_bytes()), REMEDY);
    let (json, binary) = chunks(bytes).map_err(damaged)?;
    let json =
        serde_json::from_slice(json).map_err(|error| damaged(format!("its JSON is damaged: {error}")))?;
    progress.check()?;
    Scene { json: &json, binary, polygons: Polygons::default(), placed: 0 }.read().map_err(damaged)
}

type GltfResult<T> = std::result::Result<T, String>;

/// The chunks of JSON and of numbers.
fn chunks(bytes: &[u8]) -> GltfResult<(&[u8], &[u8])> {
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    if word(4) != Some(2) {
        return Err("is not of version 2".to_owned());
    }
    let chunk = |at: usize| -> Option<(&[u8], &[u8])> {
        let (length, kind) = (word(at)? as usize, bytes.get(at + 4..at + 8)?);
        Some((kind, bytes.get(at + 8..(at + 8).checked_add(length)?)?))
    };
    let cut = || "the file ends within a chunk".to_owned();
    let (kind, json) = chunk(12).ok_or_else(cut)?;
    if kind != b"JSON" {
        return Err("does not begin with JSON".to_owned());
    }
    let next = 20 + json.len();
    let binary = if next < bytes.len() { chunk(next).ok_or_else(cut)?.1 } else { &[] };
    Ok((json, binary))
}

struct Scene<'a> {
    json: &'a Value,
    binary: &'a [u8],
    polygons: Polygons,
    /// Nodes that were placed.
    placed: usize,
}

/// Numbers of an accessor.
struct Numbers<'a> {
    bytes: &'a [u8],
    count: usize,
    stride: usize,
    kind: u64,
}

impl Scene<'_> {
    fn read(mut self) -> GltfResult<Polygons> {
        let required =
            self.json["extensionsRequired"].as_array().into_iter().flatten().filter_map(Value::as_str);
        for extension in required {
            if !HARMLESS.iter().any(|harmless| extension.starts_with(harmless))
                && extension != "KHR_mesh_quantization"
            {
                return Err(format!("needs {extension}, which is not read"));
            }
        }
        // From metres with y up.
        let up = Placement([[1000.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1000.0, 0.0], [0.0, 1000.0, 0.0, 0.0]]);
        let number = self.json["scene"].as_u64().unwrap_or(0) as usize;
        match self.json["scenes"][number]["nodes"].as_array() {
            Some(roots) => roots.iter().try_for_each(|node| self.node(node, &up, 0))?,
            None if self.json["scenes"].is_array() => {}
            // Without scenes there are meshes alone.
            None => (0..list(self.json, "meshes").len()).try_for_each(|mesh| self.mesh(mesh, &up))?,
        }
        self.polygons.finish();
        Ok(self.polygons)
    }

    fn node(&mut self, number: &Value, above: &Placement, depth: usize) -> GltfResult<()> {
        let json = self.json;
        let node = number.as_u64().and_then(|n| list(json, "nodes").get(n as usize));
        let node = node.ok_or_else(|| format!("there is no node {number}"))?;
        if depth > DEPTH_MAX {
            return Err(format!("node {number} is a child of itself"));
        }
        // Nodes have one parent each.
        self.placed += 1;
        if self.placed > list(json, "nodes").len() {
            return Err(format!("node {number} is a child of several nodes"));
        }
        let at = above.after(&placement(node)?);
        if let Some(mesh) = node["mesh"].as_u64() {
            self.mesh(mesh as usize, &at)?;
        }
        node["children"]
            .as_array()
            .into_iter()
            .flatten()
            .try_for_each(|child| self.node(child, &at, depth + 1))
    }

    fn mesh(&mut self, number: usize, at: &Placement) -> GltfResult<()> {
        let json = self.json;
        let mesh = list(json, "meshes").get(number).ok_or_else(|| format!("there is no mesh {number}"))?;
        for primitive in mesh["primitives"].as_array().into_iter().flatten() {
            let mode = primitive["mode"].as_u64().unwrap_or(4);
            let Some(position) = primitive["attributes"]["POSITION"].as_u64() else { continue };
            if !(4..=6).contains(&mode) {
                continue;
            }
            let held = self.numbers(position, "VEC3", 3)?.count;
            let corners = match primitive["indices"].as_u64() {
                Some(indices) => self.indices(indices, held)?,
                None => (0..held as u32).collect(),
            };
            if corners.len() < 3 {
                continue;
            }
            let vertices = self.positions(position)?;
            let triangle = |n: usize| match mode {
                4 => [corners[3 * n], corners[3 * n + 1], corners[3 * n + 2]],
                // Every second triangle of a strip is turned over.
                5 if n % 2 == 1 => [corners[n + 1], corners[n], corners[n + 2]],
                5 => [corners[n], corners[n + 1], corners[n + 2]],
                _ => [corners[0], corners[n + 1], corners[n + 2]],
            };
            let count = if mode == 4 { corners.len() / 3 } else { corners.len().saturating_sub(2) };
            // A byte of the file is no more than a corner.
            let room = SceneLimit::of(self.binary.len());
            let fits = self.polygons.add_placed(&vertices, (0..count).map(triangle), at, room);
            if !fits {
                return Err("its meshes stand in the scene more often than can be read".to_owned());
            }
        }
        Ok(())
    }

    fn positions(&self, accessor: u64) -> GltfResult<Vec<[f64; 3]>> {
        let normalized =
            list(self.json, "accessors").get(accessor as usize).is_some_and(|a| a["normalized"] == true);
        let numbers = self.numbers(accessor, "VEC3", 3)?;
        let largest = match numbers.kind {
            5120 => 127.0,
            5121 => 255.0,
            5122 => 32767.0,
            5123 => 65535.0,
            _ => 1.0,
        };
        let value = |bytes: &[u8]| match numbers.kind {
            5120 => f64::from(bytes[0] as i8),
            5121 => f64::from(bytes[0]),
            5122 => f64::from(i16::from_le_bytes([bytes[0], bytes[1]])),
            5123 => f64::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            _ => f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
        };
        let size = size(numbers.kind);
        let vertex = |n: usize| {
            let bytes = &numbers.bytes[n * numbers.stride..];
            [0, 1, 2].map(|a| {
                let value = value(&bytes[a * size..]);
                if normalized { (value / largest).max(-1.0) } else { value }
            })
        };
        Ok((0..numbers.count).map(vertex).collect())
    }

    fn indices(&self, accessor: u64, vertices: usize) -> GltfResult<Vec<u32>> {
        let numbers = self.numbers(accessor, "SCALAR", 1)?;
        let index = |n: usize| {
            let bytes = &numbers.bytes[n * numbers.stride..];
            let index = match numbers.kind {
                5121 => u32::from(bytes[0]),
                5123 => u32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
                5125 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
                other => return Err(format!("corners are numbers of type {other}")),
            };
            let is_there = (index as usize) < vertices;
            is_there.then_some(index).ok_or_else(|| format!("names vertex {index} of {vertices}"))
        };
        (0..numbers.count).map(index).collect()
    }

    /// The bytes of an accessor of `width` numbers an element, all of which are there.
    fn numbers(&self, accessor: u64, shape: &str, width: usize) -> GltfResult<Numbers<'_>> {
        let wrong = |what: &str| format!("accessor {accessor} {what}");
        let found =
            list(self.json, "accessors").get(accessor as usize).ok_or_else(|| wrong("is not there"))?;
        if found["type"] != shape || !found["sparse"].is_null() {
            return Err(wrong("is of a shape that is not read"));
        }
        let kind = found["componentType"].as_u64().unwrap_or(0);
        if size(kind) == 0 || kind == 5126 && shape == "SCALAR" || kind == 5125 && shape != "SCALAR" {
            return Err(wrong("is of a type that is not read"));
        }
        let view = found["bufferView"].as_u64().and_then(|n| list(self.json, "bufferViews").get(n as usize));
        let view = view.ok_or_else(|| wrong("has no buffer"))?;
        if view["buffer"].as_u64() != Some(0)
            || !list(self.json, "buffers").first().is_some_and(|b| b["uri"].is_null())
        {
            return Err("its numbers are in another file".to_owned());
        }
        let offset = |value: &Value| value.as_u64().unwrap_or(0) as usize;
        let (start, length) = (offset(&view["byteOffset"]), offset(&view["byteLength"]));
        let bytes = start.checked_add(length).and_then(|end| self.binary.get(start..end));
        let bytes = bytes.and_then(|bytes| bytes.get(offset(&found["byteOffset"])..));
        let bytes = bytes.ok_or_else(|| wrong("lies beyond the file"))?;
        let element = size(kind) * width;
        let stride = view["byteStride"].as_u64().map_or(element, |stride| stride as usize).max(element);
        let count = offset(&found["count"]);
        let needed =
            count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(element));
        if needed.is_none_or(|needed| needed > bytes.len()) {
            return Err(wrong("lies beyond its buffer"));
        }
        Ok(Numbers { bytes, count, stride, kind })
    }
}

fn list<'a>(json: &'a Value, name: &str) -> &'a [Value] {
    json[name].as_array().map_or(&[], Vec::as_slice)
}

/// Bytes of a number of a type; 0 of an unknown one.
fn size(kind: u64) -> usize {
    match kind {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        5125 | 5126 => 4,
        _ => 0,
    }
}

/// A node's place in its parent.
fn placement(node: &Value) -> GltfResult<Placement> {
    let numbers = |name: &str, count: usize| -> GltfResult<Option<Vec<f64>>> {
        let Some(all) = node[name].as_array() else { return Ok(None) };
        let all = all.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>();
        let all =
            all.filter(|all| all.len() == count).ok_or_else(|| format!("a node's {name} is damaged"))?;
        Ok(Some(all))
    };
    if let Some(m) = numbers("matrix", 16)? {
        return Ok(Placement(std::array::from_fn(|row| std::array::from_fn(|column| m[4 * column + row]))));
    }
    let mut at = Placement::IDENTITY;
    if let Some(s) = numbers("scale", 3)? {
        at = Placement::scale([s[0], s[1], s[2]]);
    }
    if let Some(q) = numbers("rotation", 4)? {
        at = Placement::turn([q[0], q[1], q[2], q[3]]).after(&at);
    }
    if let Some(t) = numbers("translation", 3)? {
        at = Placement::shift([t[0], t[1], t[2]]).after(&at);
    }
    Ok(at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    /// A tetrahedron of 1 m: positions as floats, corners as bytes.
    fn binary() -> Vec<u8> {
        let corners: [[f32; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut bytes = corners.as_flattened().iter().flat_map(|c| c.to_le_bytes()).collect::<Vec<u8>>();
        bytes.extend([0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2]);
        bytes
    }

    fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
        let json = json.as_bytes();
        let mut bytes = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        bytes.extend((json.len() as u32).to_le_bytes());
        bytes.extend(b"JSON");
        bytes.extend(json);
        bytes.extend((binary.len() as u32).to_le_bytes());
        bytes.extend(b"BIN\0");
        bytes.extend(binary);
        bytes
    }

    fn json(nodes: &str, more: &str) -> String {
        format!(
            r#"{{"asset":{{"version":"2.0"}},{more}"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{nodes}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],"buffers":[{{"byteLength":60}}],
            "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":12}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
            {{"bufferView":1,"componentType":5121,"count":12,"type":"SCALAR"}}]}}"#
        )
    }

    fn of(json: &str) -> Result<Polygons> {
        read(Path::new("a.glb"), &glb(json, &binary()), &Silent)
    }

    #[test]
    fn nodes_place_meshes_and_up_is_z() {
        let placed = r#"{"children":[1,2],"translation":[0,0.5,0]},{"mesh":0},{"mesh":0,"scale":[-1,1,1]}"#;
        let found = of(&json(placed, "")).unwrap();
        assert_eq!(found.triangles.len(), 8);
        assert_eq!(
            found.vertices[..4],
            [[0.0, 0.0, 500.0], [1000.0, 0.0, 500.0], [0.0, 0.0, 1500.0], [0.0, -1000.0, 500.0]]
        );
        // The mirrored one is turned over.
        assert_eq!((found.triangles[0], found.triangles[4]), ([0, 2, 1], [4, 5, 6]));
        let matrix = r#"{"mesh":0,"matrix":[0.001,0,0,0,0,0,-0.001,0,0,0.001,0,0,0,0,0,1]}"#;
        assert_eq!(of(&json(matrix, "")).unwrap().vertices[3], [0.0, 0.0, 1.0]);
    }

    #[test]
    fn what_cannot_be_read_is_told_in_a_line() {
        let node = r#"{"mesh":0}"#;
        for (text, what) in [
            (
                json(node, r#""extensionsRequired":["KHR_draco_mesh_compression"],"#),
                "needs KHR_draco_mesh_compression",
            ),
            (json(r#"{"children":[0]}"#, ""), "is a child of several nodes"),
            (json(r#"{"children":[1,1]},{"children":[2,2]},{"mesh":0}"#, ""), "is a child of several nodes"),
            (json(r#"{"mesh":3}"#, ""), "there is no mesh 3"),
            (json(node, "").replace(r#""count":12"#, r#""count":13"#), "lies beyond its buffer"),
            (
                json(node, "").replace(r#""byteLength":48"#, r#""byteLength":480000000000"#),
                "lies beyond the file",
            ),
            (json(node, "").replace(r#""count":4"#, r#""count":2"#), "names vertex 2 of 2"),
            (json(node, "").replace(r#""byteLength":60"#, r#""uri":"a.bin""#), "in another file"),
            ("{".to_owned(), "its JSON is damaged"),
        ] {
            let said = of(&text).unwrap_err().to_string();
            assert!(said.contains(what) && !said.contains('\n'), "{said}");
        }
        let whole = glb(&json(node, ""), &binary());
        for end in 4..whole.len() {
            assert!(read(Path::new("a.glb"), &whole[..end], &Silent).is_err(), "{end}");
        }
    }
}
