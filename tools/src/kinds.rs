//! What a file is that was given to a command, and which command wants it if this one does not.

use crate::elsewhere::{is_address, not_fetched};
use crate::failure::Failure;
use anyhow::anyhow;
use brickfield_engine::Error;
use brickfield_engine::bsp::MAGIC;
use brickfield_engine::build::is_plan;
use brickfield_engine::contour::{listed_mesh_endings, written_mesh_endings};
use brickfield_engine::export::FORMATS;
use brickfield_engine::import::endings as volume_endings;
use brickfield_engine::ingest::{InputKind, mesh_endings, readable};
use brickfield_engine::mmap::begins_with;
use brickfield_engine::store::is_store;
use std::path::{Path, PathBuf};

/// What a file is, by its content and then by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// A brick store, finished or not.
    Store,
    /// A plan, of which shards are built.
    Plan,
    /// Anything else.
    Input(InputKind),
}

impl FileKind {
    /// What the file is; what is wrong with one that cannot be read is for its reader to say.
    pub fn of(path: &Path) -> Option<FileKind> {
        if is_store(path) {
            return Some(FileKind::Store);
        }
        if is_plan(path) {
            return Some(FileKind::Plan);
        }
        InputKind::of(path).ok().map(FileKind::Input)
    }

    /// With its article, as in "a mesh (STL)"; nothing if it is unknown.
    pub fn name(self) -> Option<String> {
        Some(match self {
            FileKind::Store => "a brick store".to_owned(),
            FileKind::Plan => "a plan".to_owned(),
            FileKind::Input(InputKind::Mesh(format)) => format!("a mesh ({format})"),
            FileKind::Input(InputKind::Cloud(format)) => format!("a point cloud ({format})"),
            FileKind::Input(InputKind::Toolpath) => "a toolpath (G-code)".to_owned(),
            FileKind::Input(InputKind::X3d) => "an X3D file".to_owned(),
            FileKind::Input(InputKind::ThreeMf) => "a 3MF file".to_owned(),
            FileKind::Input(InputKind::Foreign(what)) => what?.to_owned(),
            FileKind::Input(InputKind::Empty) => "empty".to_owned(),
        })
    }

    /// Whether `build` takes it.
    pub fn is_input(self) -> bool {
        use InputKind::{Cloud, Mesh, ThreeMf, Toolpath, X3d};
        matches!(self, FileKind::Input(Mesh(_) | Cloud(_) | ThreeMf | Toolpath | X3d))
    }

    /// Whether it holds triangles of its own.
    pub fn is_mesh(self) -> bool {
        matches!(self, FileKind::Input(InputKind::Mesh(_) | InputKind::ThreeMf))
    }
}

/// Whether the name is that of a mesh whose triangles are read, there or not.
pub fn is_mesh_name(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
    ending.is_some_and(|ending| mesh_endings().any(|known| known == ending))
}

/// Whether a file begins as those of splats do.
fn is_splats(path: &Path) -> bool {
    begins_with(path, &MAGIC)
}

/// The command that makes a store of an input.
fn build_command(path: &Path) -> String {
    format!("`brickfield build {} -o {}`", typed(path), typed(&path.with_extension("brf")))
}

/// What to do with a file of splats.
fn remedy_of_splats(path: &Path) -> String {
    format!("`brickfield render {} --splats -o view.png` draws it", typed(path))
}

/// What to do with a plan.
fn remedy_of_plan(path: &Path) -> String {
    format!(
        "build its shards, as by `brickfield build {} --shard 1/8 -o shard-1.brf`, and join them",
        typed(path)
    )
}

/// The error of a file that was given in place of a store. `error` is what its reader says, which stands if the file may be
/// a store after all. `otherwise` is what the same command does with such a mesh, if anything.
pub fn not_a_store(path: &Path, error: Error, otherwise: Option<&str>) -> Error {
    if is_splats(path) {
        return Error::store(
            path,
            "header",
            "is a file of splats, not a brick store",
            remedy_of_splats(path),
        );
    }
    let Some(kind) = FileKind::of(path).filter(|kind| *kind != FileKind::Store) else { return error };
    let Some(name) = kind.name() else { return error };
    let remedy = match kind {
        _ if kind.is_input() => {
            let check = otherwise.filter(|_| kind.is_mesh()).map_or_else(String::new, |otherwise| {
                format!(", or use `brickfield {otherwise} {}`", typed(path))
            });
            let store = typed(&path.with_extension("brf"));
            format!("make one first by {}, and give {store}{check}", build_command(path))
        }
        FileKind::Plan => remedy_of_plan(path),
        _ => "give a store that `brickfield build` has finished".to_owned(),
    };
    Error::store(path, "header", format!("is {name}, not a brick store"), remedy)
}

/// Refuses stores among inputs; `wants` is the command that answers from a store what this one answers from inputs.
///
/// # Errors
/// The first store, with the command, and the first address.
pub fn require_inputs(paths: &[PathBuf], wants: &str) -> Result<(), anyhow::Error> {
    if let Some(path) = paths.iter().find(|path| is_address(path)) {
        return Err(not_fetched(path).into());
    }
    let Some(path) = paths.iter().find(|path| is_store(path)) else { return Ok(()) };
    let command = wants.replace("PART.brf", &typed(path));
    Err(anyhow!(
        "{}: is a brick store, made already, not an input; use `brickfield {command}`",
        path.display()
    ))
}

/// Refuses what is no toolpath.
///
/// # Errors
/// The first one, with the command that wants it.
pub fn require_toolpaths(paths: &[PathBuf]) -> Result<(), anyhow::Error> {
    for path in paths {
        let Some(kind) = FileKind::of(path).filter(|kind| *kind != FileKind::Input(InputKind::Toolpath))
        else {
            continue;
        };
        let Some(name) = kind.name() else { continue };
        let remedy = match kind {
            FileKind::Store => {
                format!("give the G-code; of a store `brickfield mesh {} -o OUT.stl`", typed(path))
            }
            _ if kind.is_input() => {
                format!("give the G-code; a store is made of this by {}", build_command(path))
            }
            _ => "give a G-code file".to_owned(),
        };
        return Err(anyhow!("{}: is {name}, not a toolpath; {remedy}", path.display()));
    }
    Ok(())
}

/// Endings of files that other programs read or write and that are in no table of the library.
const OTHER_ENDINGS: [(&[&str], StoreNameUse); 5] = [
    (&["gltf", "step", "stp", "iges", "igs"], StoreNameUse::Mesh),
    (&["x3d"], StoreNameUse::WrittenBy("beads")),
    (
        &[
            "gcode", "gco", "g", "nc", "ngc", "cnc", "mpf", "tap", "gz", "xz", "xyz", "pts", "asc", "pcd",
            "las", "laz", "e57", "csv", "txt",
        ],
        StoreNameUse::Read,
    ),
    (&["png", "svg", "dxf"], StoreNameUse::WrittenBy("slice")),
    (&["bsp", "html"], StoreNameUse::WrittenBy("splats")),
];

/// What a name that is not a store's is for.
#[derive(Clone, Copy)]
enum StoreNameUse {
    /// A mesh that `mesh` writes.
    WrittenMesh,
    /// A part in a format that is not written.
    Mesh,
    /// What a command writes.
    WrittenBy(&'static str),
    /// An input.
    Read,
}

impl StoreNameUse {
    fn of(ending: &str) -> Option<StoreNameUse> {
        if written_mesh_endings().any(|known| known == ending) {
            return Some(StoreNameUse::WrittenMesh);
        }
        if mesh_endings().any(|known| known == ending) {
            return Some(StoreNameUse::Mesh);
        }
        if ending == "json" || FORMATS.iter().any(|format| format.ending() == ending) {
            return Some(StoreNameUse::WrittenBy("export"));
        }
        OTHER_ENDINGS.iter().find(|(all, _)| all.contains(&ending)).map(|(_, found)| *found)
    }
}

/// Refuses a name for a store whose ending is that of a file of another kind: what would stand under it is none.
///
/// # Errors
/// Wrong usage, with the command or the option that writes such a file.
pub fn require_store_name(path: &Path, has_mesh_option: bool) -> Result<(), Failure> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    let Some(found) = ending.as_deref().and_then(StoreNameUse::of) else { return Ok(()) };
    let store = typed(&path.with_extension("brf"));
    let by_option = if has_mesh_option { format!("`--mesh {}`, or ", typed(path)) } else { String::new() };
    let remedy = match found {
        StoreNameUse::WrittenMesh => format!(
            "and of the store the mesh is written by {by_option}`brickfield mesh {store} -o {}`",
            typed(path)
        ),
        StoreNameUse::Mesh => {
            format!("and `brickfield mesh {store}` writes meshes as {}", listed_mesh_endings(" or "))
        }
        StoreNameUse::WrittenBy(command) => {
            format!("files of that ending are written by `brickfield {command}`")
        }
        StoreNameUse::Read => "files of that ending are read only".to_owned(),
    };
    let what =
        format!("this writes a brick store, not .{}; use `-o {store}`, {remedy}", ending.unwrap_or_default());
    Err(Failure::Usage(format!("{}: {what}", path.display())))
}

/// The error of a file that no command takes.
pub fn not_read(path: &Path, kind: FileKind) -> anyhow::Error {
    if is_splats(path) {
        return anyhow!("{}: is a file of splats; {}", path.display(), remedy_of_splats(path));
    }
    let (name, remedy) = match kind {
        FileKind::Input(InputKind::Empty) => {
            ("is empty".to_owned(), "export or copy the file again".to_owned())
        }
        FileKind::Plan => ("is a plan, which only `build` reads".to_owned(), remedy_of_plan(path)),
        _ => match kind.name() {
            Some(name) => (format!("is {name}, which is not read"), readable()),
            None => ("is of no kind that is known".to_owned(), readable()),
        },
    };
    let model = match name.contains("CAD model") {
        true => "export the part as a mesh: STL, OBJ or PLY".to_owned(),
        false => remedy,
    };
    anyhow!("{}: {name}; {model}", path.display())
}

/// A path as it is typed into a shell.
pub fn typed(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+,@%:=".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text;
    }
    format!("'{}'", text.replace('\'', "'\\''"))
}

/// Formats of meshes that are read, by their table.
pub fn mesh_formats() -> String {
    mesh_endings().map(str::to_uppercase).collect::<Vec<_>>().join(", ")
}

/// Formats of point clouds that are read.
const CLOUD_FORMATS: &str = "PLY, PCD, LAS, LAZ, E57, XYZ";

/// What `winding` takes.
pub fn inputs_of_winding() -> String {
    format!(
        "Toolpaths: G-code, also as .gz, .xz, .bgcode or .gcode.3mf; meshes: {}, X3D Extrusions. Or point clouds: {CLOUD_FORMATS}",
        mesh_formats()
    )
}

/// What `build` takes, by the tables of formats.
pub fn inputs_of_build() -> String {
    let volumes: Vec<_> = volume_endings().map(|ending| format!(".{ending}")).collect();
    format!("{}; or one volume: {}", inputs_of_winding(), volumes.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_quoted_for_a_shell() {
        assert_eq!(typed(Path::new("a/b-1.stl")), "a/b-1.stl");
        assert_eq!(typed(Path::new("my part's.stl")), "'my part'\\''s.stl'");
    }
}
