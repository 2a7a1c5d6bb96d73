//! Point clouds as builds read them: their points together, as surface elements.

use super::summary::PointsSummary;
use crate::error::{Error, Result};
use crate::ingest::CloudInput;
use crate::large_array::ArrayRoom;
use crate::progress::Progress;
use crate::store::Source;
use crate::winding::{Surfels, with_estimated_normals};

/// What a point takes where all arrays of it are in memory, with its clusters and the lists of two levels. Measured on a million
/// points: 277 MB in all, and 379 MB where normals are found from neighbours.
pub const BYTES_A_POINT: u64 = 400;

/// Point clouds that are built together, in the order in which they were given.
pub(super) struct CloudInputs {
    /// None when they are measured.
    given: Vec<CloudInput>,
    /// Whether normals are found from the points.
    estimate: bool,
    /// Between being measured and being in a field.
    surfels: Option<Surfels>,
    /// What was read.
    pub summary: PointsSummary,
}

impl CloudInputs {
    /// As they were read.
    pub fn given(given: Vec<CloudInput>, estimate: bool) -> CloudInputs {
        CloudInputs { given, estimate, surfels: None, summary: PointsSummary::default() }
    }

    /// What a store records of each.
    pub fn sources(&self) -> impl Iterator<Item = Result<Source>> {
        self.given.iter().map(|input| describe(input, self.estimate))
    }

    /// Measures them; see [`surfels`]. If `memory` bytes are enough for all arrays, none goes to a file from now on.
    pub fn measure(&mut self, memory: u64, progress: &dyn Progress) -> Result<&Surfels> {
        let points: u64 = self.given.iter().map(|input| input.cloud.points.len() as u64).sum();
        if points.saturating_mul(BYTES_A_POINT) <= memory {
            self.given.iter_mut().for_each(|input| input.cloud.set_room(&ArrayRoom::unbounded()));
        }
        let surfels = surfels(std::mem::take(&mut self.given), self.estimate, progress)?;
        self.summary = PointsSummary::of(&surfels);
        Ok(self.surfels.insert(surfels))
    }

    /// What was measured, for the field.
    pub fn take(&mut self) -> Surfels {
        self.surfels.take().expect("measured before, and taken once")
    }
}

/// The surface elements of the points of some files together. With `estimate`, their normals are those of
/// [`with_estimated_normals`], whatever the files say.
///
/// # Errors
/// If points lack normals, or some files' do and others' do not; if no point has an area; if the user interrupts.
pub fn surfels(inputs: Vec<CloudInput>, estimate: bool, progress: &dyn Progress) -> Result<Surfels> {
    let Some(first) = inputs.first().map(|input| input.path().to_owned()) else {
        return Err(Error::setting("there is no input", "give at least one point cloud"));
    };
    let why = inputs.iter().find_map(|input| input.columns.no_normals.clone());
    let inputs =
        if estimate { inputs.into_iter().map(CloudInput::without_normals).collect() } else { inputs };
    let mut cloud = CloudInput::join(inputs)?;
    if estimate {
        cloud = with_estimated_normals(cloud, progress)?;
    } else if cloud.normals.is_empty() {
        let why = why.map_or_else(String::new, |why| format!(" ({why})"));
        let (what, remedy) =
            (format!("have no normals{why}"), "add `estimate_normals`, or export them with normals");
        return Err(Error::input(&first, "points", what, remedy));
    }
    let surfels = Surfels::of(cloud, progress)?;
    if surfels.all.is_empty() {
        let what = format!("none of the {} points has an area", surfels.void);
        return Err(Error::input(&first, "points", what, "give several points, with normals that are not 0"));
    }
    Ok(surfels)
}

fn describe(input: &CloudInput, estimated: bool) -> Result<Source> {
    let normals = if estimated { ", estimated normals" } else { "" };
    Ok(Source {
        path: input.path().display().to_string(),
        bytes: input.bytes(),
        facets: input.cloud.points.len() as u64,
        format: format!("{}{normals}", input.describe()),
        blake3: input.identity()?,
    })
}
