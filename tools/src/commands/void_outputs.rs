//! What `brickfield voids` writes beside its table: meshes of voids, and their numbers as an array.

use crate::failure::Failure;
use crate::output::{in_line, require_distinct};
use crate::progress::Bars;
use crate::space::require_space;
use crate::units::Unit;
use crate::void_args::VoidsArgs;
use anyhow::Context;
use brickfield_engine::Error;
use brickfield_engine::contour::{MeshPart, write_three_mf_parts};
use brickfield_engine::export::npy_header;
use brickfield_engine::lattice::BRICK_CELLS;
use brickfield_engine::overlay::class_colour;
use brickfield_engine::part::{PartFile, PartPair};
use brickfield_engine::store::{BrickTree, Store};
use brickfield_engine::voids::{Class, Void, Voids, write_labels};
use serde_json::json;
use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Files that have been created.
pub struct VoidOutputs {
    mesh: Option<(PartFile, MeshKind)>,
    labels: Option<(PartPair, PathBuf)>,
}

#[derive(Clone, Copy)]
enum MeshKind {
    Ply,
    Obj,
    ThreeMf,
}

/// A mesh in which triangles share their corners.
#[derive(Default)]
struct Shared {
    numbers: HashMap<[u32; 3], u32>,
    vertices: Vec<[f32; 3]>,
    triangles: Vec<([u32; 3], u32)>,
}

impl VoidOutputs {
    /// Creates the files, so that one that cannot be written is told before the work.
    ///
    /// # Errors
    /// Names with wrong endings, of other files of the command, or that cannot be written.
    pub fn create(args: &VoidsArgs, store: &Store) -> Result<VoidOutputs, Failure> {
        let ending = |path: &PathBuf| path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let wrong = |path: &PathBuf, what: &str| {
            Failure::Usage(format!("{}: the name must end in {what}", in_line(path)))
        };
        let mut mesh = None;
        if let Some(path) = &args.mesh {
            let kind = match ending(path).as_deref() {
                Some("ply") => MeshKind::Ply,
                Some("obj") => MeshKind::Obj,
                Some("3mf") => MeshKind::ThreeMf,
                _ => return Err(wrong(path, ".ply, .obj or .3mf")),
            };
            require_distinct(&[path, &args.output], &[&args.store])?;
            mesh = Some((PartFile::create(path)?, kind));
        }
        let mut labels = None;
        if let Some(path) = &args.labels {
            if ending(path).as_deref() != Some("npy") {
                return Err(wrong(path, ".npy"));
            }
            let description = path.with_extension("json");
            let others = [&args.output, &args.store];
            require_distinct(&[path, &description], &others.map(PathBuf::as_path))?;
            let axis = axis(store) as u64;
            require_space(path, axis.pow(3) * 4, "cut the store down with `brickfield cache prune`")?;
            labels = Some((PartPair::create(path, &description)?, path.clone()));
        }
        Ok(VoidOutputs { mesh, labels })
    }

    /// Writes them.
    ///
    /// # Errors
    /// What writing gives.
    pub fn write(self, store: &Store, found: &Voids, bars: &Bars) -> Result<(), Failure> {
        if let Some((mut file, kind)) = self.mesh {
            match kind {
                MeshKind::Ply => {
                    Shared::of(&found.voids).ply(&mut file)?;
                    file.finish()?;
                }
                MeshKind::Obj => {
                    Shared::of(&found.voids).obj(&mut file)?;
                    file.finish()?;
                }
                MeshKind::ThreeMf => three_mf(file, store, &found.voids)?,
            }
        }
        let Some((mut pair, path)) = self.labels else { return Ok(()) };
        let axis = axis(store);
        let header = npy_header("<u4", axis);
        pair.file.write_at(&header, 0)?;
        // All that nothing is written to is zero.
        pair.file.write_at(&[0; 4], header.len() as u64 + (axis as u64).pow(3) * 4 - 4)?;
        let write = |offset: u64, bytes: &[u8]| pair.file.write_at(bytes, header.len() as u64 + offset);
        write_labels(store, found, bars, &write)?;
        let root = store.root();
        let description = json!({
            "array": path.file_name().map(|name| name.to_string_lossy().into_owned()),
            "store": store.path().display().to_string(),
            "order": "zyx",
            "shape": [axis, axis, axis],
            "dtype": "<u4",
            "origin": root.to_world([1.0; 3]),
            "spacing": root.edge / axis as f64,
            "unit": store.meta().unit,
        });
        let text = serde_json::to_string_pretty(&description).context("cannot write JSON")?;
        pair.description.append(format!("{text}\n").as_bytes())?;
        Ok(pair.finish()?)
    }
}

/// Samples an axis of the deepest level.
fn axis(store: &Store) -> usize {
    BRICK_CELLS << store.deepest_level()
}

/// Writes an object a void, in the colours of their classes.
fn three_mf(file: PartFile, store: &Store, voids: &[Void]) -> Result<(), Error> {
    const CLASSES: [Option<Class>; 4] = [Some(Class::Pocket), Some(Class::Infill), Some(Class::Flaw), None];
    let name = |class: Option<Class>| class.map_or("void", Class::name);
    let metres = Unit::of_symbol(&store.meta().unit).map(Unit::metres);
    let part = |void: &Void| {
        let Shared { vertices, triangles, .. } = Shared::of(std::slice::from_ref(void));
        MeshPart {
            name: format!("{} {}", name(void.class), void.id),
            colour: CLASSES.iter().position(|class| *class == void.class).unwrap_or(0),
            vertices,
            triangles: triangles.into_iter().map(|(corners, _)| corners).collect(),
        }
    };
    let colours = CLASSES.map(|class| (name(class), class_colour(class)));
    write_three_mf_parts(file, metres, &colours, voids.iter().map(part))
}

impl Shared {
    fn of(voids: &[Void]) -> Shared {
        let mut shared = Shared::default();
        for void in voids {
            // Voids that touch share no corner.
            shared.numbers.clear();
            for triangle in &void.mesh {
                let corners = triangle.map(|corner| {
                    *shared.numbers.entry(corner.map(f32::to_bits)).or_insert_with(|| {
                        shared.vertices.push(corner);
                        shared.vertices.len() as u32 - 1
                    })
                });
                shared.triangles.push((corners, void.id as u32));
            }
        }
        shared
    }

    fn ply(&self, file: &mut PartFile) -> Result<(), Error> {
        let header = format!(
            "ply\nformat binary_little_endian 1.0\ncomment voids written by Brickfield\n\
             element vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
             element face {}\nproperty list uchar uint vertex_indices\nproperty uint void\nend_header\n",
            self.vertices.len(),
            self.triangles.len()
        );
        file.append(header.as_bytes())?;
        for vertex in &self.vertices {
            file.append(vertex.map(f32::to_le_bytes).as_flattened())?;
        }
        for (corners, void) in &self.triangles {
            let mut record = [3; 17];
            record[1..13].copy_from_slice(corners.map(u32::to_le_bytes).as_flattened());
            record[13..].copy_from_slice(&void.to_le_bytes());
            file.append(&record)?;
        }
        Ok(())
    }

    fn obj(&self, file: &mut PartFile) -> Result<(), Error> {
        let mut text = String::from("# voids written by Brickfield\n");
        for [x, y, z] in &self.vertices {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "v {x} {y} {z}");
        }
        for of_void in self.triangles.chunk_by(|a, b| a.1 == b.1) {
            let _ = writeln!(text, "g void_{}", of_void[0].1);
            for ([a, b, c], _) in of_void {
                let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
            }
        }
        file.append(text.as_bytes())
    }
}
