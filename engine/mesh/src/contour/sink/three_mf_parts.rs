//! 3MF with several objects, each with a colour.

use super::three_mf::{ThreeMfSink, write_triangles, write_vertices};
use crate::error::Result;
use crate::part::PartFile;

/// A 3MF with an object a part and a material a colour, one part after the other.
pub struct ThreeMfParts {
    sink: ThreeMfSink,
    bytes: Vec<u8>,
    objects: usize,
    /// Whether a part was begun and not ended, and whether triangles of it have come.
    is_open: bool,
    has_triangles: bool,
}

impl ThreeMfParts {
    /// With these colours, red, green and blue, and their names. `metres` is the length of the unit of positions, a millimetre
    /// without it.
    ///
    /// # Errors
    /// What writing gives.
    pub fn new(file: PartFile, metres: Option<f64>, colours: &[(&str, [u8; 3])]) -> Result<ThreeMfParts> {
        let mut sink = ThreeMfSink::new(file, metres)?;
        let bases = colours.iter().map(|(name, [r, g, b])| {
            format!("<base name=\"{}\" displaycolor=\"#{r:02X}{g:02X}{b:02X}FF\"/>", escaped(name))
        });
        let bases: String = bases.collect();
        sink.write(format!("<basematerials id=\"1\">{bases}</basematerials>\n").as_bytes())?;
        Ok(ThreeMfParts { sink, bytes: Vec::new(), objects: 0, is_open: false, has_triangles: false })
    }

    /// Begins a part of this name, in which markup is escaped, and with the colour of this number.
    ///
    /// # Errors
    /// What writing gives.
    pub fn begin(&mut self, name: &str, colour: usize) -> Result<()> {
        self.end()?;
        self.objects += 1;
        (self.is_open, self.has_triangles) = (true, false);
        let head = format!(
            "<object id=\"{}\" type=\"model\" name=\"{}\" pid=\"1\" pindex=\"{colour}\">\n<mesh>\n<vertices>\n",
            self.objects + 1,
            escaped(name)
        );
        self.sink.write(head.as_bytes())
    }

    /// The next vertices of the part, world positions: all of them come before its triangles.
    ///
    /// # Errors
    /// What writing gives.
    pub fn vertices(&mut self, positions: &[[f32; 3]]) -> Result<()> {
        self.bytes.clear();
        write_vertices(positions, &mut self.bytes);
        self.sink.write(&self.bytes)
    }

    /// The next triangles of the part, by numbers of its own vertices, counter-clockwise seen from outside.
    ///
    /// # Errors
    /// What writing gives.
    pub fn triangles(&mut self, corners: &[[u32; 3]]) -> Result<()> {
        self.bytes.clear();
        if !std::mem::replace(&mut self.has_triangles, true) {
            self.bytes.extend_from_slice(b"</vertices>\n<triangles>\n");
        }
        write_triangles(corners, &mut self.bytes);
        self.sink.write(&self.bytes)
    }

    fn end(&mut self) -> Result<()> {
        if !std::mem::take(&mut self.is_open) {
            return Ok(());
        }
        if !self.has_triangles {
            self.sink.write(b"</vertices>\n<triangles>\n")?;
        }
        self.sink.write(b"</triangles>\n</mesh>\n</object>\n")
    }

    /// Ends the file.
    ///
    /// # Errors
    /// What writing gives.
    pub fn finish(mut self) -> Result<()> {
        self.end()?;
        self.sink.finish_objects(2..self.objects + 2)
    }
}

/// A text as the value of an attribute.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
