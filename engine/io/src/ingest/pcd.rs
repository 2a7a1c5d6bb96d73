//! Point clouds of the Point Cloud Library, `.pcd` of version 0.7: a header of lines, then points as text, as records, or as
//! records whose columns were put one behind the other and packed by LZF.

use super::columns::CloudColumns;
use super::text;
use crate::error::{Error, Result};
use crate::large_array::ArrayRoom;
use crate::progress::Progress;
use crate::soup::PointCloud;
use std::borrow::Cow;
use std::path::Path;

/// The header ends within so many bytes.
const HEADER_BYTES: usize = 1 << 16;
/// Bytes that LZF makes of one, at most.
const MOST_RATIO: usize = 130;
/// Points between two looks at whether the user interrupts.
const POINTS_AT_ONCE: usize = 1 << 16;
const REMEDY: &str = "save it again, as by pcl_convert_pcd_ascii_binary, or as PLY";

/// True of the beginning of a PCD file.
pub(super) fn is_pcd(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(HEADER_BYTES)];
    let mut lines = start.split(|&b| b == b'\n').map(<[u8]>::trim_ascii);
    let first = lines.find(|line| !line.is_empty() && !line.starts_with(b"#"));
    first.is_some_and(|line| line.starts_with(b"VERSION") || line.starts_with(b"FIELDS"))
        && lines.any(|line| line.starts_with(b"DATA"))
}

/// A column of the points, or several of one name.
struct Field {
    name: String,
    kind: u8,
    size: usize,
    count: usize,
}

/// What stands before the points.
struct Header<'a> {
    path: &'a Path,
    fields: Vec<Field>,
    points: usize,
    data: String,
    /// Where the points begin.
    end: usize,
}

impl<'a> Header<'a> {
    fn of(path: &'a Path, bytes: &[u8]) -> Result<Header<'a>> {
        let mut header = Header { path, fields: Vec::new(), points: 0, data: String::new(), end: 0 };
        let (mut sizes, mut kinds, mut counts, mut width, mut height) =
            (Vec::new(), Vec::new(), Vec::new(), 0, 1);
        let mut points = None;
        let start = &bytes[..bytes.len().min(HEADER_BYTES)];
        while header.data.is_empty() {
            let length = start[header.end..].iter().position(|&b| b == b'\n');
            let line = length.and_then(|length| std::str::from_utf8(&start[header.end..][..length]).ok());
            let Some(line) = line else { return Err(header.error("has no line \"DATA\"")) };
            header.end += line.len() + 1;
            let mut words = line.split_whitespace();
            let Some(word) = words.next() else { continue };
            let numbers = || words.clone().map(|word| word.parse().unwrap_or(0)).collect::<Vec<usize>>();
            match word {
                "FIELDS" | "COLUMNS" => {
                    let field = |name: &str| Field { name: name.to_owned(), kind: b'F', size: 4, count: 1 };
                    header.fields = words.map(field).collect();
                }
                "SIZE" => sizes = numbers(),
                "TYPE" => kinds = words.map(|kind| kind.as_bytes()[0]).collect(),
                "COUNT" => counts = numbers(),
                "WIDTH" => width = numbers().first().copied().unwrap_or(0),
                "HEIGHT" => height = numbers().first().copied().unwrap_or(1),
                "POINTS" => points = numbers().first().copied(),
                "DATA" => header.data = words.next().unwrap_or("none").to_owned(),
                _ => {}
            }
        }
        for (n, field) in header.fields.iter_mut().enumerate() {
            field.size = sizes.get(n).copied().unwrap_or(4);
            field.kind = kinds.get(n).copied().unwrap_or(b'F');
            field.count = counts.get(n).copied().unwrap_or(1);
        }
        let known = |field: &Field| {
            matches!((field.kind, field.size), (b'F', 4 | 8) | (b'I' | b'U', 1 | 2 | 4 | 8))
                && field.count < 1 << 16
        };
        if let Some(field) = header.fields.iter().find(|field| !known(field)) {
            let (name, kind) = (text::plain(field.name.as_bytes()), char::from(field.kind));
            return Err(header.error(format!("has the field {name} of the type {kind}{}", field.size)));
        }
        header.points = points.unwrap_or(width.saturating_mul(height));
        Ok(header)
    }

    fn error(&self, what: impl ToString) -> Error {
        Error::input(self.path, "header", what, REMEDY)
    }

    /// Bytes of a point.
    fn stride(&self) -> usize {
        self.fields.iter().map(|field| field.size * field.count).sum()
    }

    /// The numbers of three fields, if all are there.
    fn three(&self, names: [&str; 3]) -> Option<[usize; 3]> {
        let of = |name: &str| self.fields.iter().position(|field| field.name.eq_ignore_ascii_case(name));
        Some([of(names[0])?, of(names[1])?, of(names[2])?])
    }
}

/// A number of a field.
fn number(field: &Field, bytes: &[u8]) -> f64 {
    fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
        std::array::from_fn(|n| bytes[n])
    }
    match (field.kind, field.size) {
        (b'F', 4) => f64::from(f32::from_le_bytes(array(bytes))),
        (b'F', _) => f64::from_le_bytes(array(bytes)),
        (b'I', 1) => f64::from(bytes[0] as i8),
        (b'I', 2) => f64::from(i16::from_le_bytes(array(bytes))),
        (b'I', 4) => f64::from(i32::from_le_bytes(array(bytes))),
        (b'I', _) => i64::from_le_bytes(array(bytes)) as f64,
        (_, 1) => f64::from(bytes[0]),
        (_, 2) => f64::from(u16::from_le_bytes(array(bytes))),
        (_, 4) => f64::from(u32::from_le_bytes(array(bytes))),
        _ => u64::from_le_bytes(array(bytes)) as f64,
    }
}

/// Reads all points, and their normals if the file has `normal_x`, `normal_y` and `normal_z`. Points that are not there, as those
/// of depth cameras without an echo, have coordinates that are no numbers, and are left out. What is allocated is a small
/// multiple of the size of `bytes`.
///
/// # Errors
/// If the file does not follow the format or ends early.
pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    room: &ArrayRoom,
    progress: &dyn Progress,
) -> Result<(PointCloud, CloudColumns)> {
    let header = Header::of(path, bytes)?;
    let position = header.three(["x", "y", "z"]).ok_or_else(|| header.error("has no fields x, y and z"))?;
    let normals = header.three(["normal_x", "normal_y", "normal_z"]);
    let wanted: Vec<usize> = position.into_iter().chain(normals.into_iter().flatten()).collect();
    let (mut cloud, mut kept) = (PointCloud::new(room), Ok(()));
    let mut missing = 0u64;
    let mut take = |values: &[f64]| {
        if values[..3].iter().any(|c| c.is_nan()) {
            missing += 1;
            return;
        }
        if let Some((point, rest)) = values.split_first_chunk::<3>()
            && kept.is_ok()
        {
            // A normal that is unknown counts for nothing.
            let normal = rest.first_chunk::<3>();
            kept = cloud.push(*point, normal.map(|normal| normal.map(|c| if c.is_nan() { 0.0 } else { c })));
        }
    };
    match header.data.as_str() {
        "ascii" => rows_of_text(&header, bytes, &wanted, progress, &mut take)?,
        "binary" => {
            records(&header, Cow::Borrowed(&bytes[header.end..]), (&wanted, false), progress, &mut take)?
        }
        "binary_compressed" => {
            let unpacked = unpacked(&header, &bytes[header.end..])?;
            records(&header, Cow::Owned(unpacked), (&wanted, true), progress, &mut take)?;
        }
        other => return Err(header.error(format!("has data of the kind {}", text::plain(other.as_bytes())))),
    }
    kept?;
    let notes = match missing {
        0 => Vec::new(),
        _ => vec![format!("{missing} points have coordinates that are no numbers, and are left out")],
    };
    let names = header.fields.iter().map(|field| text::plain(field.name.as_bytes())).collect();
    let no_normals = normals.is_none().then(|| "no fields normal_x, normal_y and normal_z".to_owned());
    Ok((cloud, CloudColumns { names, named: true, no_normals, notes, ..CloudColumns::default() }))
}

fn rows_of_text(
    header: &Header<'_>,
    bytes: &[u8],
    wanted: &[usize],
    progress: &dyn Progress,
    take: &mut dyn FnMut(&[f64]),
) -> Result<()> {
    let columns = |field: usize| header.fields[..field].iter().map(|field| field.count).sum::<usize>();
    let columns: Vec<usize> = wanted.iter().map(|&field| columns(field)).collect();
    let lines = bytes[header.end..].split(|&b| b == b'\n').filter(|line| !line.trim_ascii().is_empty());
    let (mut points, mut values) = (0, Vec::new());
    for (n, line) in lines.take(header.points).enumerate() {
        if n % POINTS_AT_ONCE == 0 {
            progress.check()?;
        }
        let words: Vec<&str> = std::str::from_utf8(line).unwrap_or_default().split_whitespace().collect();
        values.clear();
        values.extend(columns.iter().filter_map(|&at| words.get(at)?.parse::<f64>().ok()));
        if values.len() < columns.len() {
            let place = format!("point {}", n + 1);
            return Err(Error::input(header.path, place, "has no number for each of its fields", REMEDY));
        }
        take(&values);
        points += 1;
    }
    if points < header.points {
        return Err(header.error(format!("counts {} points, but {points} are there", header.points)));
    }
    Ok(())
}

/// Points as records one behind the other, or with their columns one behind the other.
fn records(
    header: &Header<'_>,
    bytes: Cow<'_, [u8]>,
    (wanted, by_columns): (&[usize], bool),
    progress: &dyn Progress,
    take: &mut dyn FnMut(&[f64]),
) -> Result<()> {
    let stride = header.stride();
    if header.points.checked_mul(stride).is_none_or(|needed| needed > bytes.len()) {
        let there = bytes.len();
        return Err(header.error(format!(
            "counts {} points of {stride} bytes, but {there} bytes are there",
            header.points
        )));
    }
    let before =
        |field: usize| header.fields[..field].iter().map(|field| field.size * field.count).sum::<usize>();
    let places: Vec<(&Field, usize, usize)> = wanted
        .iter()
        .map(|&n| {
            let field = &header.fields[n];
            match by_columns {
                true => (field, before(n) * header.points, field.size * field.count),
                false => (field, before(n), stride),
            }
        })
        .collect();
    let mut values = Vec::new();
    for n in 0..header.points {
        if n % POINTS_AT_ONCE == 0 {
            progress.check()?;
        }
        values.clear();
        values.extend(places.iter().map(|(field, first, step)| number(field, &bytes[first + n * step..])));
        take(&values);
    }
    Ok(())
}

/// The records of packed data: two sizes, and a stream of LZF.
fn unpacked(header: &Header<'_>, bytes: &[u8]) -> Result<Vec<u8>> {
    let word =
        |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let stream = word(0).and_then(|packed| bytes.get(8..8usize.checked_add(packed)?));
    let size =
        word(4).filter(|&size| stream.is_some_and(|stream| size <= stream.len().saturating_mul(MOST_RATIO)));
    let (Some(stream), Some(size)) = (stream, size) else {
        return Err(header.error("has packed data that are cut off"));
    };
    lzf(stream, size)
        .ok_or_else(|| header.error(format!("has packed data that do not unpack to {size} bytes")))
}

/// Unpacks LZF: runs of up to 32 bytes, and copies of up to 264 bytes from up to 8192 bytes back.
fn lzf(stream: &[u8], size: usize) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(size);
    let mut at = 0;
    let byte = |at: &mut usize| {
        *at += 1;
        stream.get(*at - 1).map(|&byte| usize::from(byte))
    };
    while at < stream.len() {
        let control = byte(&mut at)?;
        if control < 32 {
            out.extend_from_slice(stream.get(at..=at + control)?);
            at += control + 1;
        } else {
            let length = control >> 5;
            let length = if length == 7 { 7 + byte(&mut at)? } else { length } + 2;
            let back = ((control & 31) << 8 | byte(&mut at)?) + 1;
            let from = out.len().checked_sub(back)?;
            (from..from + length).for_each(|at| out.push(out[at]));
        }
        if out.len() > size {
            return None;
        }
    }
    (out.len() == size).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;

    const HEAD: &str = "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS rgb x y z normal_x normal_y normal_z\n\
                        SIZE 4 4 4 8 4 4 4\nTYPE U F F F F F F\nCOUNT 2 1 1 1 1 1 1\nWIDTH 3\nHEIGHT 1\n\
                        VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA ";

    /// A point that is missing stands between two.
    const POINTS: [[f64; 6]; 3] = [
        [1.0, 2.0, 3.5, 0.0, 0.0, 1.0],
        [f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0],
        [-1.5, 0.25, 9.0, 1.0, 0.0, 0.0],
    ];

    fn field(n: usize, point: &[f64; 6]) -> Vec<u8> {
        match n {
            0 => vec![7; 8],
            3 => point[2].to_le_bytes().to_vec(),
            n => (point[n - 1] as f32).to_le_bytes().to_vec(),
        }
    }

    fn check(bytes: &[u8]) {
        assert!(is_pcd(bytes));
        let (cloud, columns) = read(Path::new("a.pcd"), bytes, &ArrayRoom::unbounded(), &Silent).unwrap();
        assert_eq!(cloud.points[..], [[1.0, 2.0, 3.5], [-1.5, 0.25, 9.0]]);
        assert_eq!(cloud.normals[..], [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]);
        assert!(columns.notes[0].starts_with("1 points") && columns.no_normals.is_none());
    }

    #[test]
    fn all_kinds_of_data_are_read() {
        let row = |p: &[f64; 6]| format!("7 7 {} {} {} {} {} {}\n", p[0], p[1], p[2], p[3], p[4], p[5]);
        check((HEAD.to_owned() + "ascii\n" + &POINTS.iter().map(row).collect::<String>()).as_bytes());
        let rows = POINTS.iter().flat_map(|p| (0..7).flat_map(|n| field(n, p)));
        check(&(HEAD.to_owned() + "binary\n").into_bytes().into_iter().chain(rows).collect::<Vec<u8>>());
        let columns: Vec<u8> = (0..7).flat_map(|n| POINTS.iter().flat_map(move |p| field(n, p))).collect();
        // The first 24 bytes are all 7: one as it is, and a copy of 23 from one byte back; the others stand there in runs.
        let mut stream = vec![0, 7, 7 << 5, 23 - 9, 0];
        for run in columns[24..].chunks(32) {
            stream.push(run.len() as u8 - 1);
            stream.extend(run);
        }
        let sizes = [stream.len() as u32, columns.len() as u32].map(u32::to_le_bytes).concat();
        let packed = [(HEAD.to_owned() + "binary_compressed\n").as_bytes(), &sizes, &stream].concat();
        check(&packed);
        for length in 0..packed.len() {
            if let Err(error) = read(Path::new("a.pcd"), &packed[..length], &ArrayRoom::unbounded(), &Silent)
            {
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }

    #[test]
    fn damage_is_told() {
        let told = |text: &str, what: &str| {
            let error = read(Path::new("a.pcd"), text.as_bytes(), &ArrayRoom::unbounded(), &Silent)
                .unwrap_err()
                .to_string();
            assert!(error.contains(what), "{error}");
        };
        told("VERSION 0.7\nFIELDS x y z\n", "no line \"DATA\"");
        told("VERSION 0.7\nFIELDS x y\nPOINTS 1\nDATA ascii\n1 2\n", "no fields x, y and z");
        told("VERSION 0.7\nFIELDS x y z\nPOINTS 2\nDATA ascii\n1 2 3\n", "counts 2 points, but 1");
        told("VERSION 0.7\nFIELDS x y z\nPOINTS 1\nDATA ascii\n1 2\n", "point 1: has no number");
        told("VERSION 0.7\nFIELDS x y z\nSIZE 4 4 3\nPOINTS 1\nDATA ascii\n", "the type F3");
        told("VERSION 0.7\nFIELDS x y z\nPOINTS 99999999999\nDATA binary\n", "0 bytes are there");
        told("VERSION 0.7\nFIELDS x y z\nPOINTS 1\nDATA text\n", "data of the kind text");
    }
}
