//! Inputs as they come: STL, OBJ, PLY, OFF, 3MF, AMF, glTF, G-code and the sweeps of X3D, each as a numbered list
//! of triangles; point clouds; and what any other file is.
//!
//! A binary STL, the form that huge soups come in, stays mapped and is decoded a range at a time. The other formats
//! are parsed into memory once, and the beads of a toolpath are swept a range at a time. [`Input::read`] hides the
//! difference.

mod amf;
mod beads;
mod bounds;
mod cloud;
mod cloud_formats;
mod cloud_text;
mod columns;
mod detect;
mod e57;
mod fields;
mod foreign;
mod formats;
#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzz;
mod gltf;
#[cfg(any(test, feature = "las", feature = "e57"))]
mod guarded;
mod las;
mod obj;
mod off;
mod origin;
mod pcd;
mod placement;
mod ply;
mod polygons;
mod stl;
mod stl_text;
mod survey;
#[cfg(test)]
mod tests;
mod text;
mod three_mf;
mod triangulate;
mod xml;

use crate::error::{Error, Result};
use crate::mmap::{Access, MappedFile};
use crate::progress::Progress;
pub use crate::soup::{Facet, Facets, PointCloud, runs};
use crate::x3d::Sweeps;
pub use beads::{InputBeads, OpenOptions, read_beads};
pub use cloud::CloudInput;
pub use columns::{CloudColumns, NormalLengths};
pub use detect::InputKind;
pub use fields::Separators;
pub use formats::{mesh_endings, readable};
pub use survey::Survey;
pub use three_mf::{ThreeMf, ThreeMfItem, ThreeMfObject};

use bounds::FacetBounds;
use detect::ReaderKind;
use origin::Origin;
use polygons::Polygons;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Positions of vertices, and triangles that name their corners by number.
pub type Indexed<'a> = (&'a [[f64; 3]], &'a [[u32; 3]]);

/// A mesh or toolpath, opened or in memory. Any number of threads may read it at once. A file that is cut short or changed while it is
/// open is an error, not a crash: of what reads it here where that says so, else of [`Input::check`].
#[derive(Debug)]
pub struct Input {
    path: PathBuf,
    origin: Origin,
    format: &'static str,
    facets: u64,
    soup: Soup,
}

impl Facets for Input {
    fn facets(&self) -> u64 {
        Input::facets(self)
    }

    fn read(&self, range: Range<u64>, out: &mut Vec<Facet>) {
        Input::read(self, range, out);
    }
}

/// What is known of a mesh of a format.
fn of_polygons(format: &'static str, polygons: Polygons) -> (&'static str, u64, Soup) {
    (format, polygons.triangles.len() as u64, Soup::Polygons(polygons))
}

/// Where the triangles are.
#[derive(Debug)]
enum Soup {
    /// In the mapped file, as a binary STL.
    Mapped,
    Facets(stl_text::TextFacets),
    Polygons(Polygons),
    Beads(Box<InputBeads>),
    Sweeps(Box<Sweeps>),
}

impl Input {
    /// Opens `path` with the default options; see [`Self::open_with`].
    ///
    /// # Errors
    /// As [`Self::open_with`].
    pub fn open(path: &Path, progress: &dyn Progress) -> Result<Input> {
        Input::open_with(path, &OpenOptions::default(), progress)
    }

    /// Opens `path` and finds out its format, by content first and then by ending; parses it unless it is a
    /// binary STL. Memory taken is bounded by a small multiple of the file's size, whatever the file claims,
    /// and nothing for binary STL.
    ///
    /// A file whose size fits the count in its 85th byte is a binary STL even if it begins with "solid". Less
    /// than 50 bytes after the last facet, or zeros of any length, are taken for padding.
    ///
    /// # Errors
    /// If the file is missing, empty, no regular file, not of a known format, or damaged: the message names the
    /// line, byte or header. Also if an option does not fit or the user interrupts.
    pub fn open_with(path: &Path, options: &OpenOptions, progress: &dyn Progress) -> Result<Input> {
        let file = MappedFile::open(path)?;
        let parsed = Input::parse(path, &file, options, progress);
        file.check()?;
        let (format, facets, soup) = parsed?;
        Ok(Input { path: path.to_owned(), origin: Origin::File(file), format, facets, soup })
    }

    /// A mesh in memory: `triangles` name their corners among `vertices`, counter-clockwise seen from outside. Messages and
    /// stores call it `name`, which may be any text.
    ///
    /// # Errors
    /// [`Error::Input`] if a triangle names a vertex that is not there.
    pub fn of_triangles(name: &str, vertices: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Result<Input> {
        let path = PathBuf::from(name);
        let is_bad = |triangle: &[u32; 3]| triangle.iter().any(|&corner| corner as usize >= vertices.len());
        if let Some(number) = triangles.iter().position(is_bad) {
            let [a, b, c] = triangles[number];
            let what = format!("names the vertices {a}, {b} and {c} of {}", vertices.len());
            let place = format!("triangle {number}");
            return Err(Error::input(
                &path,
                place,
                what,
                "number vertices from 0, and hand over all of them",
            ));
        }
        let origin = Origin::memory(|add| {
            vertices.iter().for_each(|vertex| add(vertex.map(f64::to_le_bytes).as_flattened()));
            triangles.iter().for_each(|triangle| add(triangle.map(u32::to_le_bytes).as_flattened()));
        });
        let facets = triangles.len() as u64;
        let mut polygons = Polygons::default();
        (polygons.vertices, polygons.triangles) = (vertices, triangles);
        let soup = Soup::Polygons(polygons);
        Ok(Input { path, origin, format: "triangles in memory", facets, soup })
    }

    /// What is in a file: the name of its format, how many facets, and those.
    fn parse(
        path: &Path,
        file: &MappedFile,
        options: &OpenOptions,
        progress: &dyn Progress,
    ) -> Result<(&'static str, u64, Soup)> {
        let bytes = file.bytes();
        let family = detect::family(path, bytes)?;
        file.advise(Access::Sequential);
        if !matches!(family, ReaderKind::BinaryStl | ReaderKind::Gcode) {
            progress.phase("reading", Some(file.len()), "bytes");
        }
        Ok(match family {
            ReaderKind::BinaryStl => ("STL binary", stl::facets(path, bytes)?, Soup::Mapped),
            ReaderKind::AsciiStl => {
                let facets = stl_text::read(path, bytes, progress)?;
                ("STL ASCII", facets.all.len() as u64, Soup::Facets(facets))
            }
            ReaderKind::Polygons(format) => {
                let read = format.read.expect("formats that are told by the table have a reader");
                let (polygons, format) = read(path, bytes, progress)?;
                of_polygons(format, polygons)
            }
            ReaderKind::ThreeMf => of_polygons("3MF", three_mf::read(path, bytes, progress)?),
            ReaderKind::Gcode => {
                let beads = beads::read(path, options, progress)?;
                ("G-code", beads.swept.facets(), Soup::Beads(Box::new(beads)))
            }
            ReaderKind::X3d => {
                let sweeps = Sweeps::read(path, bytes, progress)?;
                ("X3D", sweeps.facets(), Soup::Sweeps(Box::new(sweeps)))
            }
        })
    }

    /// Whether all that was read so far is what the file held when it was opened. To be asked after a pass of
    /// [`Self::read`] and before anything is made of it that lasts.
    ///
    /// # Errors
    /// If the file has been cut short or changed, or cannot be read any more.
    pub fn check(&self) -> Result<()> {
        self.origin.check()
    }

    /// Where it was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The format, as in "STL binary", "STL ASCII", "OBJ", "PLY binary little-endian", "G-code",
    /// "X3D", "OFF", "3MF", "AMF", "glTF binary", "triangles in memory".
    pub fn describe(&self) -> &'static str {
        self.format
    }

    /// Size of the file, or of the arrays, in bytes.
    pub fn bytes(&self) -> u64 {
        self.origin.len()
    }

    /// Number of triangles, polygons having been split.
    pub fn facets(&self) -> u64 {
        self.facets
    }

    /// The toolpath and its sweep, if the input is one.
    pub fn beads(&self) -> Option<&InputBeads> {
        match &self.soup {
            Soup::Beads(beads) => Some(beads),
            _ => None,
        }
    }

    /// The sweeps of an X3D file, if the input is one.
    pub fn sweeps(&self) -> Option<&Sweeps> {
        match &self.soup {
            Soup::Sweeps(sweeps) => Some(sweeps),
            _ => None,
        }
    }

    /// Memory that the parsed facets or beads take; none for a binary STL, which stays in the file.
    pub fn heap_bytes(&self) -> u64 {
        let bytes = match &self.soup {
            Soup::Mapped => 0,
            Soup::Beads(beads) => return beads.swept.heap_bytes(),
            Soup::Facets(facets) => size_of_val(facets.all.as_slice()),
            Soup::Polygons(polygons) => {
                size_of_val(polygons.triangles.as_slice()) + size_of_val(polygons.vertices.as_slice())
            }
            Soup::Sweeps(sweeps) => return sweeps.heap_bytes(),
        };
        bytes as u64
    }

    /// Vertices and the triangles between them, if the format has such: every index has its vertex. Coordinates are as
    /// in the file.
    pub fn indexed(&self) -> Option<Indexed<'_>> {
        match &self.soup {
            Soup::Polygons(polygons) => Some((&polygons.vertices, &polygons.triangles)),
            _ => None,
        }
    }

    /// Number of faces with fewer than three corners, which were left out.
    pub fn skipped_faces(&self) -> u64 {
        match &self.soup {
            Soup::Polygons(polygons) => polygons.skipped,
            _ => 0,
        }
    }

    /// Number of X3D Extrusions whose sweeps were inside out and are turned over.
    pub fn turned_sweeps(&self) -> u64 {
        match &self.soup {
            Soup::Sweeps(sweeps) => sweeps.report().turned,
            _ => 0,
        }
    }

    /// What of the file was left out, and what else the user should know: one line each, with the place.
    pub fn warnings(&self) -> Vec<String> {
        match &self.soup {
            Soup::Sweeps(sweeps) => sweeps.report().warnings(),
            Soup::Polygons(polygons) => polygons.warnings.clone(),
            Soup::Facets(stl_text::TextFacets { open_end: Some(line), .. }) => {
                vec![format!(
                    "line {line}: the text ends without \"endsolid\": if it was cut off, copy or export it again"
                )]
            }
            _ => Vec::new(),
        }
    }

    /// Replaces the content of `out` by the facets of `range` (numbered from 0; what lies beyond
    /// [`Self::facets`] is left out). Coordinates are as in the file, thus possibly NaN or infinite unless
    /// [`Self::bounds`] has passed, and zeros where the file has lost them, which [`Self::check`] tells. Allocates only
    /// if `out` lacks room; ask for some 16,384 facets at a time.
    pub fn read(&self, range: Range<u64>, out: &mut Vec<Facet>) {
        out.clear();
        let to = range.end.min(self.facets) as usize;
        let from = (range.start as usize).min(to);
        match &self.soup {
            Soup::Mapped => {
                out.extend(stl::records(self.origin.bytes(), from, to).iter().map(stl::corners));
            }
            Soup::Facets(facets) => {
                out.extend_from_slice(&facets.all[from..to]);
            }
            Soup::Polygons(polygons) => {
                let corners = |triangle: &[u32; 3]| triangle.map(|v| polygons.vertices[v as usize]);
                out.extend(polygons.triangles[from..to].iter().map(corners));
            }
            Soup::Beads(beads) => beads.swept.read(from as u64..to as u64, out),
            Soup::Sweeps(sweeps) => sweeps.append(from as u64..to as u64, out),
        }
    }

    /// Lower and upper corner of the box around all facets; vertices that no facet uses do not count. One
    /// pass over the facets on all threads.
    ///
    /// # Errors
    /// If there are no facets; if a facet has a coordinate that is NaN or infinite, naming the first such
    /// facet, counted from 1; if the file has changed since it was opened; if the user interrupts.
    pub fn bounds(&self, progress: &dyn Progress) -> Result<([f64; 3], [f64; 3])> {
        if self.facets == 0 {
            let remedy = "give a mesh with at least one triangle";
            return Err(Error::input(&self.path, self.format, "has no facets", remedy));
        }
        let extent = bounds::of_all(self.facets, progress, |range| self.extent(range))?;
        self.check()?;
        extent.corners().map_err(|facet| self.not_finite(facet))
    }

    fn extent(&self, range: Range<u64>) -> FacetBounds {
        let (from, to) = (range.start as usize, range.end as usize);
        match &self.soup {
            Soup::Mapped => stl::extent(stl::records(self.origin.bytes(), from, to)),
            Soup::Facets(facets) => FacetBounds::of(facets.all[from..to].iter().copied()),
            Soup::Polygons(polygons) => FacetBounds::of(
                polygons.triangles[from..to].iter().map(|t| t.map(|v| polygons.vertices[v as usize])),
            ),
            Soup::Beads(beads) => {
                let mut facets = Vec::new();
                beads.swept.read(range, &mut facets);
                FacetBounds::of(facets.into_iter())
            }
            Soup::Sweeps(sweeps) => {
                let mut facets = Vec::with_capacity(to - from);
                sweeps.append(range, &mut facets);
                FacetBounds::of(facets.into_iter())
            }
        }
    }

    /// The error for `facet` (from 0), which has a coordinate that is not finite.
    fn not_finite(&self, facet: u64) -> Error {
        let mut corners = Vec::new();
        self.read(facet..facet + 1, &mut corners);
        let is_bad = |corner: &&[f64; 3]| !corner.iter().all(|c| c.is_finite());
        let [x, y, z] = corners.as_flattened().iter().find(is_bad).copied().unwrap_or([f64::NAN; 3]);
        Error::input(
            &self.path,
            format!("facet {}", facet + 1),
            format!("has the corner ({x}, {y}, {z}), which is not finite"),
            "remove or repair the facet, or export the file again",
        )
    }
}

/// Lower and upper corner of the box around several inputs.
///
/// # Errors
/// As [`Input::bounds`], of the first input that fails.
pub fn bounds_of_all(inputs: &[Input], progress: &dyn Progress) -> Result<([f64; 3], [f64; 3])> {
    let bounds: Vec<_> = inputs.iter().map(|input| input.bounds(progress)).collect::<Result<_>>()?;
    Ok(bounds_of(bounds.into_iter()))
}

/// The box around boxes.
fn bounds_of(boxes: impl Iterator<Item = ([f64; 3], [f64; 3])>) -> ([f64; 3], [f64; 3]) {
    boxes.fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |all, (min, max)| {
        (std::array::from_fn(|a| all.0[a].min(min[a])), std::array::from_fn(|a| all.1[a].max(max[a])))
    })
}
