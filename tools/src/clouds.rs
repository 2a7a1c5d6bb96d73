//! Point clouds among what was typed.

use crate::failure::Failure;
use crate::output::{require_distinct, warn};
use brickfield_engine::ingest::CloudInput;
use brickfield_engine::{Error, Progress};
use std::path::{Path, PathBuf};

/// Opens all inputs if they are point clouds, having checked that none of them would be overwritten; `None` if none is.
///
/// # Errors
/// If some are and others are not; as wrong usage if there are none and normals are to be estimated.
pub fn open_clouds(
    paths: &[PathBuf],
    outputs: &[&Path],
    estimate_normals: bool,
    progress: &dyn Progress,
) -> Result<Option<Vec<CloudInput>>, Failure> {
    let are_clouds: Vec<bool> =
        paths.iter().map(|path| CloudInput::is_one(path)).collect::<Result<_, Error>>()?;
    if !are_clouds.contains(&true) {
        let name = paths[0].display();
        let wrong = format!("--estimate-normals is for point clouds; {name} is none");
        return if estimate_normals { Err(Failure::Usage(wrong)) } else { Ok(None) };
    }
    if let Some(other) = are_clouds.iter().position(|is_cloud| !is_cloud) {
        let (what, remedy) =
            ("is none, among point clouds", "give point clouds apart from meshes and toolpaths");
        return Err(Error::input(&paths[other], "points", what, remedy).into());
    }
    let names: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
    require_distinct(outputs, &names)?;
    let opened: Vec<CloudInput> =
        paths.iter().map(|path| CloudInput::open(path, progress)).collect::<Result<_, Error>>()?;
    for input in &opened {
        input.warnings().iter().for_each(|told| warn(&format!("{}: {told}", input.path().display())));
    }
    Ok(Some(opened))
}
