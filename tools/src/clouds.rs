//! Point clouds among what was typed.

use crate::failure::Failure;
use crate::memory::budget;
use crate::output::warn;
use crate::units::Size;
use brickfield_engine::build::{MixedInput, Resources};
use brickfield_engine::ingest::{CloudInput, Input};
use brickfield_engine::large_array::ArrayRoom;
use brickfield_engine::{Error, Progress};
use clap::Args;
use std::env;
use std::path::{Path, PathBuf};

/// Where the points of clouds are kept that are only asked something.
#[derive(Args)]
pub struct CloudRoomArgs {
    /// Memory for the points of clouds, as in 4GiB, maps of files not counted; by default half of what the machine has. What does
    /// not fit goes to temporary files, but for 24 bytes a point
    #[arg(long, value_name = "SIZE")]
    pub memory: Option<Size>,
    /// Folder of these files, which have no names there and vanish with the program; the system's own by default
    #[arg(long, value_name = "DIR")]
    pub temp_dir: Option<PathBuf>,
}

impl CloudRoomArgs {
    /// The room of each array of points.
    pub fn of_arrays(&self) -> ArrayRoom {
        let folder = self.temp_dir.clone().unwrap_or_else(env::temp_dir);
        let memory = budget(self.memory).map_or(u64::MAX, |size| size.0);
        let resources = Resources { memory, temp_dir: Some(folder), ..Resources::default() };
        resources.array_room(Path::new(""))
    }
}

/// Inputs by their kind, each in the order in which they were typed.
pub struct TypedInputs {
    /// Point clouds.
    pub clouds: Vec<PathBuf>,
    /// All others.
    pub others: Vec<PathBuf>,
    are_clouds: Vec<bool>,
}

impl TypedInputs {
    /// Looks what the files are.
    ///
    /// # Errors
    /// If one is missing; as wrong usage if there is no cloud and normals are to be estimated.
    pub fn of(paths: &[PathBuf], estimate_normals: bool) -> Result<TypedInputs, Failure> {
        let are_clouds: Vec<bool> =
            paths.iter().map(|path| CloudInput::is_one(path)).collect::<Result<_, Error>>()?;
        if estimate_normals && !are_clouds.contains(&true) {
            let name = paths[0].display();
            return Err(Failure::Usage(format!("--estimate-normals is for point clouds; {name} is none")));
        }
        let of_kind = |is_cloud: bool| -> Vec<PathBuf> {
            let alike = paths.iter().zip(&are_clouds).filter(|(_, kind)| **kind == is_cloud);
            alike.map(|(path, _)| path.clone()).collect()
        };
        Ok(TypedInputs { clouds: of_kind(true), others: of_kind(false), are_clouds })
    }

    /// All, once they are open, in the order in which they were typed.
    pub fn mixed(&self, clouds: Vec<CloudInput>, others: Vec<Input>) -> Vec<MixedInput> {
        let (mut clouds, mut others) = (clouds.into_iter(), others.into_iter());
        let next = |is_cloud: &bool| match is_cloud {
            true => clouds.next().map(MixedInput::Cloud),
            false => others.next().map(MixedInput::Mesh),
        };
        self.are_clouds.iter().filter_map(next).collect()
    }
}

/// Opens point clouds, each array of which has so much room in memory, and says what the user should know of them.
///
/// # Errors
/// If one cannot be read.
pub fn open_clouds(
    paths: &[PathBuf],
    room: &ArrayRoom,
    progress: &dyn Progress,
) -> Result<Vec<CloudInput>, Failure> {
    let open = |path: &PathBuf| CloudInput::open_within(path, room, progress);
    let opened: Vec<CloudInput> = paths.iter().map(open).collect::<Result<_, Error>>()?;
    for input in &opened {
        input.warnings().iter().for_each(|told| warn(&format!("{}: {told}", input.path().display())));
    }
    Ok(opened)
}
