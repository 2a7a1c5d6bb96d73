//! The mesh of a node as binary glTF 2.0, in metres. glTF has y up and tiles have z up, so readers turn what they read.

use super::super::sink::{ASSET, CHUNK_BYTES, HEAD_BYTES, glb_head};

/// Ends of the JSON and of the data, in bytes: 3D Tiles wants both at multiples of eight.
const ALIGNMENT: usize = 8;

/// A mesh with z up.
#[derive(Default)]
pub(super) struct TileMesh {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub indices: Vec<u32>,
}

/// The file of a mesh that has triangles.
pub(super) fn tile_bytes(mesh: &TileMesh) -> Vec<u8> {
    let turned = |[x, y, z]: [f32; 3]| [x, z, -y];
    let (mut data, mut low, mut high) = (Vec::new(), [f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        let position = turned(*position);
        low = std::array::from_fn(|a| low[a].min(position[a]));
        high = std::array::from_fn(|a| high[a].max(position[a]));
        data.extend(position.iter().chain(&turned(*normal)).flat_map(|c| c.to_le_bytes()));
    }
    let vertices_bytes = data.len();
    // 65535 is not allowed as an index of 16 bits.
    let is_short = mesh.positions.len() <= usize::from(u16::MAX);
    for index in &mesh.indices {
        match is_short {
            true => data.extend((*index as u16).to_le_bytes()),
            false => data.extend(index.to_le_bytes()),
        }
    }
    let indices_bytes = data.len() - vertices_bytes;
    data.resize(data.len().next_multiple_of(ALIGNMENT), 0);
    let [low, high] = [low, high].map(|at| at.map(|c| format!("{:e}", f64::from(c))).join(","));
    let (vertices, indices) = (mesh.positions.len(), mesh.indices.len());
    let component = if is_short { 5123 } else { 5125 };
    let json = [
        format!(r#"{{{ASSET},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"#),
        r#""meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1},"indices":2,"material":0}]}],"#.to_owned(),
        r#""materials":[{"pbrMetallicRoughness":{"baseColorFactor":[0.34,0.39,0.47,1],"metallicFactor":0,"roughnessFactor":0.7}}],"#
            .to_owned(),
        format!(r#""accessors":[{{"bufferView":0,"componentType":5126,"count":{vertices},"type":"VEC3","min":[{low}],"max":[{high}]}},"#),
        format!(r#"{{"bufferView":0,"byteOffset":12,"componentType":5126,"count":{vertices},"type":"VEC3"}},"#),
        format!(r#"{{"bufferView":1,"componentType":{component},"count":{indices},"type":"SCALAR"}}],"#),
        format!(r#""bufferViews":[{{"buffer":0,"byteLength":{vertices_bytes},"byteStride":24,"target":34962}},"#),
        format!(r#"{{"buffer":0,"byteOffset":{vertices_bytes},"byteLength":{indices_bytes},"target":34963}}],"#),
        format!(r#""buffers":[{{"byteLength":{}}}]}}"#, data.len()),
    ]
    .concat();
    // Both chunks end at a multiple of eight.
    const HEAD: usize = HEAD_BYTES + CHUNK_BYTES;
    let json_bytes = (HEAD + json.len()).next_multiple_of(ALIGNMENT) - HEAD;
    let mut bytes = glb_head(&json, json_bytes, Some(data.len() as u64));
    bytes.extend(data);
    bytes
}
