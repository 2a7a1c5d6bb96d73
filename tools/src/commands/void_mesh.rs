//! The file with the meshes of voids.

use super::mesh_place::{MeshPlace, PlaceWish};
use crate::failure::Failure;
use crate::output::in_line;
use crate::progress::Bars;
use crate::units::Unit;
use brickfield_engine::Error;
use brickfield_engine::contour::{FaceColumns, MeshSink, PlacedSink, ThreeMfParts};
use brickfield_engine::overlay::class_colour;
use brickfield_engine::part::PartFile;
use brickfield_engine::store::Store;
use brickfield_engine::voids::{Class, Void, VoidMeshOptions, VoidMeshSink, Voids, write_meshes};
use std::path::{Path, PathBuf};

/// Classes of voids, each with a colour in a 3MF.
const CLASSES: [Option<Class>; 4] = [Some(Class::Pocket), Some(Class::Infill), Some(Class::Flaw), None];

/// The file, before the meshes are known.
pub struct VoidMeshFile {
    folder: PathBuf,
    memory: u64,
    place: MeshPlace,
    kind: VoidMeshKind,
}

enum VoidMeshKind {
    Placed(Box<PlacedSink<'static>>),
    ThreeMf(Box<ThreeMfObjects>),
}

/// An object a void. Numbers of vertices begin anew with each.
struct ThreeMfObjects {
    file: ThreeMfParts,
    void: usize,
    /// Vertices of the voids before this one, and of all so far.
    before: u32,
    vertices: u32,
}

impl VoidMeshFile {
    /// Creates the file, by the end of its name. Pieces of meshes wait in a temporary file in `folder`.
    ///
    /// # Errors
    /// Names with wrong endings; files that cannot be written; formats whose coordinates cannot tell the store's cells apart.
    pub fn create(
        path: &Path,
        store: &Store,
        (memory, folder): (u64, &Path),
    ) -> Result<VoidMeshFile, Failure> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        let is_three_mf = match ending.as_deref() {
            Some("ply" | "obj" | "vtp") => false,
            Some("3mf") => true,
            _ => {
                let what = "the name must end in .ply, .obj, .vtp or .3mf";
                return Err(Failure::Usage(format!("{}: {what}", in_line(path))));
            }
        };
        let wish =
            PlaceWish { double_formats: ".ply, .obj or .vtp", has_origin: false, ..PlaceWish::default() };
        let place = MeshPlace::of(wish, store, path)?;
        let kind = match is_three_mf {
            true => VoidMeshKind::ThreeMf(Box::new(ThreeMfObjects::create(path, store)?)),
            false => {
                let columns = FaceColumns { names: vec!["void"], comments: Vec::new() };
                let sink = PlacedSink::with_columns(path, place.coordinates(), columns)?;
                VoidMeshKind::Placed(Box::new(sink))
            }
        };
        Ok(VoidMeshFile { folder: folder.to_owned(), memory, place, kind })
    }

    /// Writes the meshes.
    ///
    /// # Errors
    /// What making and writing them gives.
    pub fn write(self, store: &Store, found: &Voids, bars: &Bars) -> Result<(), Failure> {
        let VoidMeshFile { folder, memory, place, mut kind } = self;
        let options = VoidMeshOptions { memory, folder: &folder, origin: place.base().unwrap_or_default() };
        write_meshes(store, found, &options, &mut kind, bars)?;
        match kind {
            VoidMeshKind::Placed(mut sink) => sink.finish()?,
            VoidMeshKind::ThreeMf(objects) => objects.file.finish()?,
        }
        Ok(())
    }
}

impl ThreeMfObjects {
    fn create(path: &Path, store: &Store) -> Result<ThreeMfObjects, Error> {
        let metres = Unit::of_symbol(&store.meta().unit).map(Unit::metres);
        let colours = CLASSES.map(|class| (name_of(class), class_colour(class)));
        let file = ThreeMfParts::new(PartFile::create(path)?, metres, &colours)?;
        Ok(ThreeMfObjects { file, void: 0, before: 0, vertices: 0 })
    }

    /// Begins the void's object with its first vertices.
    fn enter(&mut self, void: &Void) -> Result<(), Error> {
        if self.void == void.id {
            return Ok(());
        }
        (self.void, self.before) = (void.id, self.vertices);
        let colour = CLASSES.iter().position(|class| *class == void.class).unwrap_or(0);
        self.file.begin(&format!("{} {}", name_of(void.class), void.id), colour)
    }
}

fn name_of(class: Option<Class>) -> &'static str {
    class.map_or("void", Class::name)
}

impl VoidMeshSink for VoidMeshKind {
    fn is_void_by_void(&self) -> bool {
        matches!(self, VoidMeshKind::ThreeMf(_))
    }

    fn vertices(&mut self, void: &Void, positions: &[[f32; 3]]) -> Result<(), Error> {
        match self {
            VoidMeshKind::Placed(sink) => sink.vertices(positions),
            VoidMeshKind::ThreeMf(objects) => {
                objects.enter(void)?;
                objects.vertices += positions.len() as u32;
                objects.file.vertices(positions)
            }
        }
    }

    fn triangles(&mut self, void: &Void, corners: &[[u32; 3]]) -> Result<(), Error> {
        match self {
            VoidMeshKind::Placed(sink) => {
                sink.numbered_triangles(corners, &vec![void.id as i32; corners.len()])
            }
            VoidMeshKind::ThreeMf(objects) => {
                let before = objects.before;
                let own: Vec<[u32; 3]> = corners.iter().map(|corners| corners.map(|n| n - before)).collect();
                objects.file.triangles(&own)
            }
        }
    }
}
