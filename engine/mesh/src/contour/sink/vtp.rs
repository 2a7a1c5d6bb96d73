//! VTK's PolyData, `.vtp`: XML that says where arrays begin in the raw bytes behind it (VTK file formats, XML, appended data).
//!
//! Lengths are known at the end only, so the XML is written twice, the second time over the first.

use super::ply::vertex_bytes;
use super::{MeshChunk, MeshEncoding, MeshSink, TriangleBytes, folder_of};
use crate::error::Result;
use crate::part::PartFile;
use crate::part::temporary::TempFile;
use std::fmt::Write;
use std::path::Path;

/// What digits of counts and places take more than zeros do.
const ROOM_BYTES: usize = 1024;
/// Before each array its length stands.
const LENGTH_BYTES: usize = 8;
/// Triangles whose ends are written at once.
const AT_ONCE: u64 = 1 << 16;

/// An array of the file.
struct VtpArray {
    name: String,
    /// Its type, as in "Float32".
    kind: &'static str,
    components: usize,
    /// Where its length stands; nothing before it begins.
    begins: Option<u64>,
    bytes: u64,
}

impl VtpArray {
    fn new(name: &str, kind: &'static str, components: usize) -> VtpArray {
        VtpArray { name: name.to_owned(), kind, components, begins: None, bytes: 0 }
    }

    fn xml(&self, data: u64) -> String {
        let VtpArray { name, kind, components, .. } = self;
        let offset = self.begins.map_or(0, |at| at - data);
        format!(
            r#"<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="appended" offset="{offset}"/>"#
        )
    }
}

/// Where arrays stand in the list of a file.
const POINTS: usize = 0;
const CORNERS: usize = 1;
const ENDS: usize = 2;
const OTHERS: usize = 3;

/// What numbers of a mesh belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NumbersOf {
    /// A number of 32 bits, a float, of each vertex.
    Vertices,
    /// An integer of 32 bits of each triangle.
    Triangles,
}

/// A `.vtp` file to be written from front to back: points, then corners of triangles, then numbers.
pub struct VtpFile {
    file: PartFile,
    arrays: Vec<VtpArray>,
    numbers: NumbersOf,
    comments: String,
    head_bytes: usize,
    points: u64,
    triangles: u64,
}

impl VtpFile {
    /// With coordinates of 64 bits or 32, and with numbers of these names. Each of `comments` is a line of the XML.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn new(
        file: PartFile,
        is_double: bool,
        numbers: (NumbersOf, &[&str]),
        comments: &[String],
    ) -> Result<VtpFile> {
        let points = if is_double { "Float64" } else { "Float32" };
        let mut arrays = vec![
            VtpArray::new("Points", points, 3),
            VtpArray::new("connectivity", "Int64", 1),
            VtpArray::new("offsets", "Int64", 1),
        ];
        let kind = if numbers.0 == NumbersOf::Vertices { "Float32" } else { "Int32" };
        arrays.extend(numbers.1.iter().map(|name| VtpArray::new(name, kind, 1)));
        // Two lines in a row may not stand in a comment.
        let line = |text: &String| format!("<!-- {} -->\n", text.replace("--", "- -"));
        let comments = comments.iter().map(line).collect();
        let numbers = numbers.0;
        let mut new = VtpFile { file, arrays, numbers, comments, head_bytes: 0, points: 0, triangles: 0 };
        new.head_bytes = new.xml().len() + ROOM_BYTES;
        let head = new.head();
        new.file.append(&head)?;
        Ok(new)
    }

    /// Where the raw bytes begin.
    fn data(&self) -> u64 {
        self.head_bytes as u64
    }

    fn xml(&self) -> String {
        let data = self.data();
        let [points, corners, ends] = [POINTS, CORNERS, ENDS].map(|n| self.arrays[n].xml(data));
        let mut numbers = String::new();
        for array in &self.arrays[OTHERS..] {
            // Writing to memory cannot fail.
            let _ = writeln!(numbers, "{}", array.xml(data));
        }
        let element = if self.numbers == NumbersOf::Vertices { "PointData" } else { "CellData" };
        let first =
            self.arrays.get(OTHERS).map_or_else(String::new, |array| format!(r#" Scalars="{}""#, array.name));
        format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\">\n<!-- written by Brickfield -->\n{}<PolyData>\n<Piece NumberOfPoints=\"{}\" \
             NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n\
             <{element}{first}>\n{numbers}</{element}>\n<Points>\n{points}\n</Points>\n<Polys>\n{corners}\n{ends}\n\
             </Polys>\n</Piece>\n</PolyData>\n",
            self.comments, self.points, self.triangles
        )
    }

    /// All before the raw bytes, always as long.
    fn head(&self) -> Vec<u8> {
        const END: &[u8] = b"<AppendedData encoding=\"raw\">\n_";
        let mut head = self.xml().into_bytes();
        head.resize(self.head_bytes - END.len(), b' ');
        head.extend_from_slice(END);
        head
    }

    /// Appends to an array; one that another array followed has ended.
    fn append(&mut self, array: usize, bytes: &[u8]) -> Result<()> {
        if self.arrays[array].begins.is_none() {
            self.arrays[array].begins = Some(self.file.appended());
            self.file.append(&[0; LENGTH_BYTES])?;
        }
        self.arrays[array].bytes += bytes.len() as u64;
        self.file.append(bytes)
    }

    /// The next points: their coordinates, little-endian.
    ///
    /// # Errors
    /// What writing gives.
    pub fn points(&mut self, count: usize, bytes: &[u8]) -> Result<()> {
        self.points += count as u64;
        self.append(POINTS, bytes)
    }

    /// The next triangles: the numbers of their corners as [`vtp_corners`] makes them. All points have come.
    ///
    /// # Errors
    /// What writing gives.
    pub fn triangles(&mut self, count: usize, bytes: &[u8]) -> Result<()> {
        // In a mesh of nothing points come first, too.
        self.append(POINTS, &[])?;
        self.triangles += count as u64;
        self.append(CORNERS, bytes)
    }

    /// The next bytes of the numbers with that place among their names. All triangles and the numbers before them have come.
    ///
    /// # Errors
    /// What writing gives.
    pub fn numbers(&mut self, place: usize, bytes: &[u8]) -> Result<()> {
        self.triangles(0, &[])?;
        self.append(OTHERS + place, bytes)
    }

    /// How many points and triangles there are.
    pub fn counts(&self) -> (u64, u64) {
        (self.points, self.triangles)
    }

    /// Where the file will stand.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// The file is complete and gets its name.
    ///
    /// # Errors
    /// What writing gives.
    pub fn finish(&mut self) -> Result<()> {
        self.triangles(0, &[])?;
        for place in 0..self.arrays.len() - OTHERS {
            self.numbers(place, &[])?;
        }
        self.append(ENDS, &[])?;
        for from in (0..self.triangles).step_by(AT_ONCE as usize) {
            let to = (from + AT_ONCE).min(self.triangles);
            let ends: Vec<u8> = (from..to).flat_map(|n| (3 * (n + 1)).to_le_bytes()).collect();
            self.append(ENDS, &ends)?;
        }
        self.file.append(b"\n</AppendedData>\n</VTKFile>\n")?;
        for VtpArray { begins, bytes, .. } in &self.arrays {
            if let Some(at) = begins {
                self.file.overwrite(*at, &bytes.to_le_bytes())?;
            }
        }
        let head = self.head();
        self.file.overwrite(0, &head)?;
        self.file.finish()
    }
}

/// Appends the numbers of the corners of triangles, as a `.vtp` has them.
pub fn vtp_corners(triangles: &[[u32; 3]], bytes: &mut Vec<u8>) {
    bytes.reserve(24 * triangles.len());
    for id in triangles.as_flattened() {
        bytes.extend_from_slice(&u64::from(*id).to_le_bytes());
    }
}

/// Columns of numbers of triangles, which wait in a file without a name until all triangles have come.
pub(super) struct WaitingNumbers {
    columns: Vec<TempFile>,
}

impl WaitingNumbers {
    pub(super) fn new(columns: usize, folder: Option<&Path>) -> WaitingNumbers {
        let folder = folder.unwrap_or(Path::new("."));
        WaitingNumbers { columns: (0..columns).map(|_| TempFile::new(folder)).collect() }
    }

    /// Takes rows, one number of each column after the other.
    pub(super) fn push(&self, rows: &[i32]) -> Result<()> {
        for (n, column) in self.columns.iter().enumerate() {
            let numbers = rows.iter().skip(n).step_by(self.columns.len());
            column.append(&numbers.flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>())?;
        }
        Ok(())
    }

    /// Hands them on, one column after the other, each with its number.
    pub(super) fn each(&self, mut take: impl FnMut(usize, &[u8]) -> Result<()>) -> Result<()> {
        let mut bytes = vec![0; 1 << 16];
        for (n, column) in self.columns.iter().enumerate() {
            for at in (0..column.bytes()).step_by(bytes.len()) {
                let length = (column.bytes() - at).min(bytes.len() as u64) as usize;
                column.read(at, &mut bytes[..length])?;
                take(n, &bytes[..length])?;
            }
        }
        Ok(())
    }
}

/// A mesh without numbers, with coordinates of 32 bits.
pub(super) struct VtpSink {
    file: VtpFile,
}

impl VtpSink {
    pub(super) fn new(file: PartFile) -> Result<VtpSink> {
        Ok(VtpSink { file: VtpFile::new(file, false, (NumbersOf::Triangles, &[]), &[])? })
    }
}

impl MeshSink for VtpSink {
    fn encoding(&self) -> Option<MeshEncoding> {
        Some(MeshEncoding { vertices: vertex_bytes(false), triangles: TriangleBytes::Numbered(vtp_corners) })
    }

    fn folder(&self) -> Option<&Path> {
        folder_of(self.file.path())
    }

    fn encoded(&mut self, part: MeshChunk<'_>) -> Result<()> {
        match part {
            MeshChunk::Vertices(count, bytes) => self.file.points(count, bytes),
            MeshChunk::Triangles(count, bytes) => self.file.triangles(count, bytes),
        }
    }

    fn finish(&mut self) -> Result<()> {
        self.file.finish()
    }
}
