//! The file formats that the program reads.

use crate::vector::{cross, norm, scale, sub};
use crate::{Mesh, StlFacet};
use std::io::{self, Write};

/// Writes a binary STL file facet by facet.
#[derive(Debug)]
pub struct StlWriter<W: Write> {
    out: W,
    left: u32,
}

impl<W: Write> StlWriter<W> {
    /// Begins a file of exactly `count` facets, which the format wants to know first. `out` should be buffered.
    ///
    /// # Errors
    /// If `count` does not fit the format's 32 bits, or `out` fails.
    pub fn new(mut out: W, count: u64) -> io::Result<StlWriter<W>> {
        let left = u32::try_from(count).map_err(|_| io::Error::other("STL holds at most 2^32 - 1 facets"))?;
        let mut header = [b' '; 80];
        header[..20].copy_from_slice(b"Brickfield test data");
        out.write_all(&header)?;
        out.write_all(&left.to_le_bytes())?;
        Ok(StlWriter { out, left })
    }

    /// Writes one facet with its unit normal (0 if it has no area).
    ///
    /// # Errors
    /// If there are more facets than announced, or `out` fails.
    pub fn facet(&mut self, facet: &StlFacet) -> io::Result<()> {
        self.left = self.left.checked_sub(1).ok_or_else(|| io::Error::other("more facets than announced"))?;
        let mut record = [0u8; 50];
        for (i, v) in std::iter::once(&normal(facet)).chain(facet).flatten().enumerate() {
            record[4 * i..4 * i + 4].copy_from_slice(&v.to_le_bytes());
        }
        self.out.write_all(&record)
    }

    /// Writes all facets of a mesh, rounded to f32.
    ///
    /// # Errors
    /// As [`StlWriter::facet`].
    pub fn mesh(&mut self, mesh: &Mesh) -> io::Result<()> {
        mesh.facets().try_for_each(|f| self.facet(&f.map(|v| v.map(|c| c as f32))))
    }

    /// Ends the file and hands the flushed output back.
    ///
    /// # Errors
    /// If there are fewer facets than announced, or `out` fails.
    pub fn finish(mut self) -> io::Result<W> {
        if self.left != 0 {
            return Err(io::Error::other(format!("{} announced facets are missing", self.left)));
        }
        self.out.flush()?;
        Ok(self.out)
    }
}

fn normal(facet: &StlFacet) -> [f32; 3] {
    let [a, b, c] = facet.map(|v| v.map(f64::from));
    let n = cross(sub(b, a), sub(c, a));
    let length = norm(n);
    if length > 0.0 { scale(n, 1.0 / length).map(|c| c as f32) } else { [0.0; 3] }
}

/// Writes a whole mesh as binary STL.
///
/// # Errors
/// If `out` fails.
pub fn stl(out: impl Write, mesh: &Mesh) -> io::Result<()> {
    let mut writer = StlWriter::new(out, mesh.triangles.len() as u64)?;
    writer.mesh(mesh)?;
    writer.finish().map(drop)
}

/// Writes a mesh as ASCII STL, every coordinate with the digits that give the same f32 back.
///
/// # Errors
/// If `out` fails.
pub fn stl_ascii(mut out: impl Write, name: &str, mesh: &Mesh) -> io::Result<()> {
    writeln!(out, "solid {name}")?;
    for facet in mesh.soup() {
        let n = normal(&facet);
        writeln!(out, "  facet normal {:e} {:e} {:e}\n    outer loop", n[0], n[1], n[2])?;
        for v in facet {
            writeln!(out, "      vertex {:e} {:e} {:e}", v[0], v[1], v[2])?;
        }
        writeln!(out, "    endloop\n  endfacet")?;
    }
    writeln!(out, "endsolid {name}")?;
    out.flush()
}

/// Writes a mesh as OBJ, every coordinate with the digits that give the same f64 back.
///
/// # Errors
/// If `out` fails.
pub fn obj(mut out: impl Write, mesh: &Mesh) -> io::Result<()> {
    for v in &mesh.vertices {
        writeln!(out, "v {} {} {}", v[0], v[1], v[2])?;
    }
    for t in &mesh.triangles {
        writeln!(out, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1)?;
    }
    out.flush()
}

fn ply_header(out: &mut impl Write, mesh: &Mesh, format: &str, scalar: &str) -> io::Result<()> {
    writeln!(out, "ply\nformat {format} 1.0\ncomment Brickfield test data")?;
    writeln!(out, "element vertex {}", mesh.vertices.len())?;
    for axis in ["x", "y", "z"] {
        writeln!(out, "property {scalar} {axis}")?;
    }
    writeln!(out, "element face {}", mesh.triangles.len())?;
    writeln!(out, "property list uchar int vertex_indices\nend_header")
}

/// Writes a mesh as ASCII PLY in double precision.
///
/// # Errors
/// If `out` fails.
pub fn ply_ascii(mut out: impl Write, mesh: &Mesh) -> io::Result<()> {
    ply_header(&mut out, mesh, "ascii", "double")?;
    for v in &mesh.vertices {
        writeln!(out, "{} {} {}", v[0], v[1], v[2])?;
    }
    for t in &mesh.triangles {
        writeln!(out, "3 {} {} {}", t[0], t[1], t[2])?;
    }
    out.flush()
}

/// Writes a mesh as binary little-endian PLY, vertices rounded to f32 as most programs do.
///
/// # Errors
/// If `out` fails.
pub fn ply_binary(mut out: impl Write, mesh: &Mesh) -> io::Result<()> {
    ply_header(&mut out, mesh, "binary_little_endian", "float")?;
    for c in mesh.vertices.iter().flatten() {
        out.write_all(&(*c as f32).to_le_bytes())?;
    }
    for t in &mesh.triangles {
        out.write_all(&[3])?;
        for v in t {
            out.write_all(&v.to_le_bytes())?;
        }
    }
    out.flush()
}

/// Passes bytes on to `out` and hashes them on the way: 64-bit FNV-1a.
#[derive(Debug)]
pub struct HashingWriter<W> {
    out: W,
    hash: u64,
    bytes: u64,
}

impl<W> HashingWriter<W> {
    /// Starts with the hash of nothing.
    pub fn new(out: W) -> HashingWriter<W> {
        HashingWriter { out, hash: 0xcbf2_9ce4_8422_2325, bytes: 0 }
    }

    /// Hash of the bytes written so far.
    pub fn hash(&self) -> u64 {
        self.hash
    }

    /// Bytes written so far.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

impl<W: Write> Write for HashingWriter<W> {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        let written = self.out.write(buffer)?;
        for &byte in &buffer[..written] {
            self.hash = (self.hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
