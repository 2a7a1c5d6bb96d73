//! Point clouds: PLY without faces, PCD, LAS, E57, and text with a point a line.

use super::cloud_formats::{CloudFormat, TEXT};
use super::columns::{CloudColumns, NormalLengths, short};
use super::origin::Origin;
use super::{InputKind, detect};
use crate::error::{Error, Result};
use crate::large_array::{ArrayRoom, LargeArray};
use crate::mmap::{Access, MappedFile};
use crate::progress::Progress;
use crate::soup::PointCloud;
use std::path::{Path, PathBuf};

/// A point cloud, opened or in memory.
#[derive(Debug)]
pub struct CloudInput {
    path: PathBuf,
    origin: Origin,
    format: &'static str,
    in_millimetres: bool,
    /// Its points.
    pub cloud: PointCloud,
    /// What its columns hold.
    pub columns: CloudColumns,
}

impl CloudInput {
    /// Whether a file is a point cloud: a PLY without faces, a PCD, LAS, LAZ or E57, or text that ends in .xyz, .pts or
    /// .asc, or holds nothing but lines of numbers.
    ///
    /// # Errors
    /// If the file is missing.
    pub fn is_one(path: &Path) -> Result<bool> {
        let file = MappedFile::open(path)?;
        let kind = detect::what_is(path, file.bytes());
        file.check()?;
        Ok(matches!(kind, InputKind::Cloud(_)))
    }

    /// Reads a point cloud, which [`CloudInput::is_one`] knows: a PLY, PCD, LAS or E57, with its normals if it has
    /// those; or text, whose columns have names or are understood by their numbers. LAZ and E57 take the features `las` and
    /// `e57`.
    ///
    /// # Errors
    /// If the file is missing or damaged, has no points, has a coordinate that is not finite, or is changed meanwhile: the
    /// message names the line, byte or point.
    pub fn open(path: &Path, progress: &dyn Progress) -> Result<CloudInput> {
        CloudInput::open_within(path, &ArrayRoom::unbounded(), progress)
    }

    /// As [`CloudInput::open`], with so much room in memory for points, and as much for normals.
    ///
    /// # Errors
    /// As there; if the temporary file for more cannot be written.
    pub fn open_within(path: &Path, room: &ArrayRoom, progress: &dyn Progress) -> Result<CloudInput> {
        let file = MappedFile::open(path)?;
        let bytes = file.bytes();
        file.advise(Access::Sequential);
        progress.phase("reading", Some(file.len()), "bytes");
        let CloudFormat { described, in_millimetres, read, .. } =
            CloudFormat::of(path, bytes).unwrap_or(&TEXT);
        let read = read(path, bytes, room, progress);
        file.check()?;
        let (cloud, columns) = read?;
        check(&cloud, path)?;
        Ok(CloudInput {
            path: path.to_owned(),
            origin: Origin::File(file),
            format: described,
            in_millimetres: *in_millimetres,
            cloud,
            columns,
        })
    }

    /// A point cloud in memory, with an outward normal of any length for each point, or with none. Messages and stores call
    /// it `name`, which may be any text.
    ///
    /// # Errors
    /// [`Error::Input`] if there are no points, or not as many normals, or if a coordinate is not finite.
    pub fn of_points(name: &str, cloud: PointCloud) -> Result<CloudInput> {
        let path = PathBuf::from(name);
        let (points, normals) = (cloud.points.len(), cloud.normals.len());
        if normals != 0 && normals != points {
            let what = format!("there are {normals} of them for {points} points");
            return Err(Error::input(&path, "normals", what, "hand over one for each point, or none"));
        }
        check(&cloud, &path)?;
        let origin = Origin::memory(|add| {
            let all = cloud.points.iter().chain(cloud.normals.iter());
            all.for_each(|vector| add(vector.map(f64::to_le_bytes).as_flattened()));
        });
        let columns = CloudColumns::default();
        Ok(CloudInput { path, origin, format: "points in memory", in_millimetres: false, cloud, columns })
    }

    /// How long the normals are, if there are any.
    pub fn normals(&self) -> Option<NormalLengths> {
        (!self.cloud.normals.is_empty()).then(|| NormalLengths::of(self.cloud.normals.iter().copied()))
    }

    /// What the user should know, a sentence each.
    pub fn warnings(&self) -> Vec<String> {
        let mut all = self.columns.notes.clone();
        // Of what has none but zeros the build says more.
        if let Some(NormalLengths { zero: zero @ 1.., count, .. }) = self.normals()
            && zero < count
        {
            all.push(format!("{zero} of {count} normals are 0: their points count for nothing"));
        }
        all
    }

    /// What the columns hold, for people.
    pub fn columns_text(&self) -> String {
        let CloudColumns { names, named, decimal_commas, no_normals, .. } = &self.columns;
        let mut text = names.join(" ");
        if !named && names.len() > 3 {
            text += " (by their numbers)";
        }
        if *decimal_commas {
            text += ", with decimal commas";
        }
        match (self.normals(), no_normals) {
            (Some(NormalLengths { zero, unit, count, min, max, .. }), _) => {
                let lengths = match unit == count {
                    true => "all of length 1".to_owned(),
                    false => format!("lengths {} to {}, {zero} are 0", short(min), short(max)),
                };
                text + &format!("; normals given, {lengths}")
            }
            (None, Some(why)) => text + &format!("; no normals: {why}"),
            (None, None) => text + "; no normals",
        }
    }

    /// Where it was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The format: "PLY points", "PCD points", "LAS points", "E57 points", "XYZ points" or "points in memory".
    pub fn describe(&self) -> &'static str {
        self.format
    }

    /// Whether the format says its unit, so that positions are in millimetres.
    pub fn is_in_millimetres(&self) -> bool {
        self.in_millimetres
    }

    /// Size of the file, or of the arrays, in bytes.
    pub fn bytes(&self) -> u64 {
        self.origin.len()
    }

    /// As [`super::Input::identity`].
    ///
    /// # Errors
    /// As there.
    pub fn identity(&self) -> Result<[u8; 32]> {
        self.origin.identity()
    }

    /// The same as if the file had no normals.
    #[must_use]
    pub fn without_normals(mut self) -> CloudInput {
        self.cloud.normals = LargeArray::new(self.cloud.points.room());
        self
    }

    /// The points of some files as one cloud.
    ///
    /// # Errors
    /// If some have normals and others do not.
    pub fn join(inputs: Vec<CloudInput>) -> Result<PointCloud> {
        let mut all = PointCloud::default();
        for CloudInput { path, cloud, columns, .. } in inputs {
            if !all.points.is_empty() && cloud.normals.is_empty() != all.normals.is_empty() {
                let why = columns.no_normals.map_or_else(String::new, |why| format!(" ({why})"));
                let what = match cloud.normals.is_empty() {
                    true => format!("has no normals, and the clouds before it have some{why}"),
                    false => "has normals, and the clouds before it have none".to_owned(),
                };
                let remedy = "give all with normals, or estimate those of all";
                return Err(Error::input(&path, "points", what, remedy));
            }
            if all.points.is_empty() {
                all = cloud;
            } else {
                all.append(&cloud)?;
            }
        }
        Ok(all)
    }
}

/// Refuses a cloud without points, or with a coordinate that is not finite.
pub(super) fn check(cloud: &PointCloud, path: &Path) -> Result<()> {
    if cloud.points.is_empty() {
        return Err(Error::input(path, "points", "there are none", "give at least one point"));
    }
    let finite = |v: &[f64; 3]| v.iter().all(|c| c.is_finite());
    let bad = |list: &[[f64; 3]]| list.iter().position(|v| !finite(v));
    match bad(&cloud.points).or_else(|| bad(&cloud.normals)) {
        None => Ok(()),
        Some(number) => Err(Error::input(
            path,
            format!("point {}", number + 1),
            "has a coordinate that is not finite",
            "remove the point or export the file again",
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    fn open(name: &str, content: &[u8]) -> Result<Option<PointCloud>> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join(name);
        std::fs::write(&path, content).expect("writable");
        let read = || CloudInput::open(&path, &Silent).map(|input| input.cloud);
        CloudInput::is_one(&path)?.then(read).transpose()
    }

    #[test]
    fn text_and_ply_give_the_same_cloud() {
        let expected =
            PointCloud::of(vec![[1.0, 2.0, 3.0], [4.0, 5.5, -6.0]], vec![[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]);
        let text = b"# a scan\n1 2 3 0 0 1\r\n\n4, 5.5, -6, 1, 0, 0\n";
        assert_eq!(open("a.XYZ", text).unwrap().unwrap(), expected);
        let header = |format: &str| {
            format!(
                "ply\nformat {format} 1.0\nelement vertex 2\nproperty float nx\nproperty float ny\nproperty \
                 float nz\nproperty uchar red\nproperty double x\nproperty double y\nproperty double z\n\
                 element face 0\nproperty list uchar int vertex_indices\nend_header\n"
            )
        };
        let ascii = header("ascii") + "0 0 1 9 1 2 3\n1 0 0 9 4 5.5 -6\n";
        assert_eq!(open("a.ply", ascii.as_bytes()).unwrap().unwrap(), expected);
        for big in [false, true] {
            let format = if big { "binary_big_endian" } else { "binary_little_endian" };
            let mut bytes = header(format).into_bytes();
            for (p, n) in expected.points.iter().zip(expected.normals.iter()) {
                n.iter().map(|c| *c as f32).for_each(|c| {
                    bytes.extend(if big { c.to_be_bytes() } else { c.to_le_bytes() });
                });
                bytes.push(9);
                p.iter().for_each(|c| bytes.extend(if big { c.to_be_bytes() } else { c.to_le_bytes() }));
            }
            assert_eq!(open("a.ply", &bytes).unwrap().unwrap(), expected);
            assert!(open("a.ply", &bytes[..bytes.len() - 3]).is_err());
        }
        let bare = open("a.xyz", b"1 2 3\n4 5 6\n").unwrap().unwrap();
        assert_eq!((bare.points.len(), bare.normals.len()), (2, 0));
    }

    #[test]
    fn meshes_are_none_and_damage_is_named() {
        assert_eq!(open("a.stl", b"solid a\nendsolid a\n").unwrap(), None);
        let mesh = b"ply\nformat ascii 1.0\nelement vertex 0\nelement face 1\nend_header\n";
        assert_eq!(open("a.ply", mesh).unwrap(), None);
        for (content, what) in [
            (&b"1 2 3\n1 2\n"[..], "line 2: 2 numbers"),
            (b"1 2 3 4\n1 2 3\n", "line 2: 3 numbers"),
            (b"1 2 x\n", "\"x\" is not a number"),
            (b"1 2 3\n1 nan 3\n", "point 2: has a coordinate that is not finite"),
            (b"# nothing\n", "there are none"),
        ] {
            let message = open("a.xyz", content).unwrap_err().to_string();
            assert!(message.contains(what), "{message}");
        }
    }
}
