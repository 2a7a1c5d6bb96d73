//! The scans of an E57 file.

use crate::error::{Error, Result};
use crate::ingest::columns::{CloudColumns, Column};
use crate::ingest::guarded::guarded;
use crate::ingest::placement::Placement;
use crate::ingest::text;
use crate::large_array::{ArrayRoom, LargeArray};
use crate::progress::Progress;
use crate::soup::PointCloud;
use e57::{E57Reader, Record, RecordDataType, RecordName, RecordValue, Transform};
use std::io::Cursor;
use std::path::Path;

const REMEDY: &str = "copy or export the file again, or convert it to PLY or LAS";
/// The format counts in metres.
const MILLIMETRES: f64 = 1000.0;
/// Points between two looks at whether the user interrupts.
const POINTS_AT_ONCE: usize = 1 << 14;

/// Reads the points of all scans where their poses place them, in millimetres; and their normals if all scans have them, by
/// the extension of surface normals. Points that a scan marks as invalid are left out. What is allocated is a small
/// multiple of the points that are there.
///
/// # Errors
/// If the file does not follow the format, a checksum is wrong, or points are missing; if the user interrupts.
pub(in crate::ingest) fn read(
    path: &Path,
    bytes: &[u8],
    room: &ArrayRoom,
    progress: &dyn Progress,
) -> Result<(PointCloud, CloudColumns)> {
    let damaged = |place: String, what: &str| Error::input(path, place, text::plain(what.as_bytes()), REMEDY);
    let opened = guarded(|| E57Reader::new(Cursor::new(bytes)));
    let mut file = match opened {
        Some(Ok(file)) => file,
        Some(Err(error)) => return Err(damaged("header".to_owned(), &error.to_string())),
        None => return Err(damaged("header".to_owned(), "is damaged")),
    };
    let scans = file.pointclouds();
    let (mut all, mut invalid, mut lacking) = (PointCloud::new(room), 0, None);
    let mut names: Vec<String> = Vec::new();
    for (number, scan) in scans.iter().enumerate() {
        let place = format!("scan {} of {}", number + 1, scans.len());
        let layout = ScanLayout::of(scan).map_err(|what| damaged(place.clone(), &what))?;
        if lacking.is_none() && layout.normal.is_none() && scan.records > 0 {
            lacking = Some(number);
        }
        let new = scan.prototype.iter().map(|record| name_of(&record.name));
        names.extend(new.filter(|name| !names.contains(name)).collect::<Vec<_>>());
        let mut points = match guarded(|| file.pointcloud_raw(scan)) {
            Some(Ok(points)) => points,
            Some(Err(error)) => return Err(damaged(place, &error.to_string())),
            None => return Err(damaged(place, "is damaged")),
        };
        loop {
            progress.check()?;
            let mut some = Vec::with_capacity(POINTS_AT_ONCE);
            let mut take = || -> std::result::Result<usize, String> {
                let mut taken = 0;
                for values in points.by_ref().take(POINTS_AT_ONCE) {
                    match layout.point(&values.map_err(|e| e.to_string())?)? {
                        Some(point) => some.push(point),
                        None => invalid += 1,
                    }
                    taken += 1;
                }
                Ok(taken)
            };
            match guarded(&mut take) {
                Some(Ok(0)) => break,
                Some(Ok(_)) => {}
                Some(Err(what)) => return Err(damaged(place, &what)),
                None => return Err(damaged(place, "is damaged")),
            }
            some.into_iter().try_for_each(|(point, normal)| all.push(point, normal))?;
        }
    }
    let no_normals = lacking.map(|number| {
        all.normals = LargeArray::default();
        format!("scan {} of {} has no numbers normalX, normalY and normalZ", number + 1, scans.len())
    });
    let notes = match invalid {
        0 => Vec::new(),
        _ => vec![format!("{invalid} points are marked as invalid, and are left out")],
    };
    Ok((all, CloudColumns { names, named: true, no_normals, notes, ..CloudColumns::default() }))
}

/// A name as it stands in the file, without the prefix of its extension.
fn name_of(name: &RecordName) -> String {
    match name {
        RecordName::Unknown { name, .. } => text::plain(name.as_bytes()),
        known => {
            let name = format!("{known:?}");
            name[..1].to_ascii_lowercase() + &name[1..]
        }
    }
}

/// Where coordinates stand among the numbers of a point.
enum Position {
    Cartesian([usize; 3]),
    /// Range, azimuth, elevation.
    Spherical([usize; 3]),
}

/// Where a point is, and its normal.
type OrientedPoint = ([f64; 3], Option<[f64; 3]>);

/// How the numbers of a scan become points.
struct ScanLayout<'a> {
    records: &'a [Record],
    position: Position,
    normal: Option<[usize; 3]>,
    /// What is not 0 where a point has no place.
    invalid: Option<usize>,
    /// Of normals, and of places in metres.
    turn: Placement,
    pose: Placement,
}

impl<'a> ScanLayout<'a> {
    fn of(scan: &'a e57::PointCloud) -> std::result::Result<ScanLayout<'a>, String> {
        let records = &scan.prototype;
        // Otherwise no bytes would be needed for any number of points.
        if records.iter().all(|record| is_constant(&record.data_type)) && scan.records > 0 {
            return Err("has points all at one place".to_owned());
        }
        let at = |wanted: RecordName| records.iter().position(|record| record.name == wanted);
        let three = |names: [RecordName; 3]| {
            let [x, y, z] = names.map(at);
            Some([x?, y?, z?])
        };
        let cartesian = three([RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ]);
        let spherical =
            three([RecordName::SphericalRange, RecordName::SphericalAzimuth, RecordName::SphericalElevation]);
        let (position, state) = match (cartesian, spherical) {
            (Some(places), _) => (Position::Cartesian(places), RecordName::CartesianInvalidState),
            (None, Some(places)) => (Position::Spherical(places), RecordName::SphericalInvalidState),
            (None, None) => return Err("has neither cartesian nor spherical coordinates".to_owned()),
        };
        let normal = |axis: usize| {
            let is_it = |record: &Record| match &record.name {
                RecordName::Unknown { name, .. } => Column::of_name(name.as_bytes()) == Column::Normal(axis),
                _ => false,
            };
            records.iter().position(is_it)
        };
        let [nx, ny, nz] = [0, 1, 2].map(normal);
        let normal = nx.zip(ny).zip(nz).map(|((nx, ny), nz)| [nx, ny, nz]);
        let (turn, pose) = pose(scan.transform.as_ref())?;
        Ok(ScanLayout { records, position, normal, invalid: at(state), turn, pose })
    }

    fn number(&self, values: &[RecordValue], at: usize) -> std::result::Result<f64, String> {
        values[at].to_f64(&self.records[at].data_type).map_err(|error| error.to_string())
    }

    fn three(&self, values: &[RecordValue], at: [usize; 3]) -> std::result::Result<[f64; 3], String> {
        let [x, y, z] = at.map(|at| self.number(values, at));
        Ok([x?, y?, z?])
    }

    /// A point with its normal if it has one; `None` if it has no place.
    fn point(&self, values: &[RecordValue]) -> std::result::Result<Option<OrientedPoint>, String> {
        if let Some(at) = self.invalid
            && self.number(values, at)? != 0.0
        {
            return Ok(None);
        }
        let local = match self.position {
            Position::Cartesian(at) => self.three(values, at)?,
            Position::Spherical(at) => {
                let [range, azimuth, elevation] = self.three(values, at)?;
                let flat = range * libm::cos(elevation);
                [flat * libm::cos(azimuth), flat * libm::sin(azimuth), range * libm::sin(elevation)]
            }
        };
        if local.iter().any(|c| c.is_nan()) {
            return Ok(None);
        }
        // A normal that is unknown counts for nothing.
        let known = |c: f64| if c.is_finite() { c } else { 0.0 };
        let normal =
            self.normal.map(|at| Ok::<_, String>(self.turn.place(self.three(values, at)?.map(known))));
        Ok(Some((self.pose.place(local).map(|c| c * MILLIMETRES), normal.transpose()?)))
    }
}

/// Whether a number takes no bytes, since it is always the same.
fn is_constant(kind: &RecordDataType) -> bool {
    match kind {
        RecordDataType::ScaledInteger { min, max, .. } | RecordDataType::Integer { min, max } => min >= max,
        RecordDataType::Single { .. } | RecordDataType::Double { .. } => false,
    }
}

/// The rotation, and it with the translation in metres.
fn pose(transform: Option<&Transform>) -> std::result::Result<(Placement, Placement), String> {
    let transform = transform.cloned().unwrap_or_default();
    let (turn, to) = (&transform.rotation, &transform.translation);
    let (translation, quaternion) = ([to.x, to.y, to.z], [turn.w, turn.x, turn.y, turn.z]);
    let length = quaternion.iter().map(|c| c * c).sum::<f64>().sqrt();
    if !length.is_finite() || length == 0.0 || translation.iter().any(|c| !c.is_finite()) {
        return Err("has a pose that is no rotation and translation".to_owned());
    }
    let turn = if quaternion[1..] == [0.0; 3] {
        Placement::IDENTITY
    } else {
        let [w, x, y, z] = quaternion.map(|c| c / length);
        Placement::turn([x, y, z, w])
    };
    Ok((turn, Placement::shift(translation).after(&turn)))
}
