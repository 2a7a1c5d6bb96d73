//! 3MF with several objects, each with a colour.

use super::three_mf::{ThreeMfSink, write_triangles, write_vertices};
use crate::error::Result;
use crate::part::PartFile;

/// A closed mesh among others in a file.
pub struct MeshPart {
    /// Its name; markup is escaped.
    pub name: String,
    /// Its colour: number of one of the file's.
    pub colour: usize,
    /// World positions.
    pub vertices: Vec<[f32; 3]>,
    /// Numbers of corners among the part's own vertices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Writes a 3MF with an object a part and a material a colour, red, green and blue, with their names. `metres` is the length of the
/// unit of positions, a millimetre without it.
///
/// # Errors
/// What writing gives.
pub fn write_three_mf_parts(
    file: PartFile,
    metres: Option<f64>,
    colours: &[(&str, [u8; 3])],
    parts: impl Iterator<Item = MeshPart>,
) -> Result<()> {
    let mut sink = ThreeMfSink::new(file, metres)?;
    let bases = colours.iter().map(|(name, [r, g, b])| {
        format!("<base name=\"{}\" displaycolor=\"#{r:02X}{g:02X}{b:02X}FF\"/>", escaped(name))
    });
    let bases: String = bases.collect();
    sink.write(format!("<basematerials id=\"1\">{bases}</basematerials>\n").as_bytes())?;
    let (mut bytes, mut count) = (Vec::new(), 0);
    for part in parts.filter(|part| !part.triangles.is_empty()) {
        count += 1;
        let MeshPart { name, colour, vertices, triangles } = part;
        let head = format!(
            "<object id=\"{}\" type=\"model\" name=\"{}\" pid=\"1\" pindex=\"{colour}\">\n<mesh>\n<vertices>\n",
            count + 1,
            escaped(&name)
        );
        bytes.clear();
        bytes.extend_from_slice(head.as_bytes());
        write_vertices(&vertices, &mut bytes);
        bytes.extend_from_slice(b"</vertices>\n<triangles>\n");
        write_triangles(&triangles, &mut bytes);
        bytes.extend_from_slice(b"</triangles>\n</mesh>\n</object>\n");
        sink.write(&bytes)?;
    }
    sink.finish_objects(2..count + 2)
}

/// A text as the value of an attribute.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
