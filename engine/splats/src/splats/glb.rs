//! Splats as points in binary glTF, which the extension `KHR_gaussian_splatting` says to draw as Gaussians. Who does not know
//! it draws points in the same colours.
//!
//! The extension's numbers are linear: standard deviations, opacity from 0 to 1, quaternions with w last. glTF counts in metres
//! and has y up; a matrix turns the part, which has z up, and scales it.

use super::gaussian::{Gaussian, GaussianSource, OPACITY};
use crate::error::{Error, Result};
use crate::part::PartFile;
use std::path::Path;

/// Header of the file, and of a chunk.
const HEAD_BYTES: u64 = 12;
const CHUNK_BYTES: u64 = 8;
/// Component types.
const FLOAT: u32 = 5126;
const BYTE: u32 = 5121;
/// What a point has, one after the other: semantic, kind, component type, bytes.
const ATTRIBUTES: [(&str, &str, u32, u64); 6] = [
    ("POSITION", "VEC3", FLOAT, 12),
    ("COLOR_0", "VEC4", BYTE, 4),
    ("KHR_gaussian_splatting:SCALE", "VEC3", FLOAT, 12),
    ("KHR_gaussian_splatting:ROTATION", "VEC4", FLOAT, 16),
    ("KHR_gaussian_splatting:OPACITY", "SCALAR", FLOAT, 4),
    ("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", "VEC3", FLOAT, 12),
];
/// Bytes of a point.
const POINT_BYTES: u64 = 60;

/// Writes Gaussians as points. `metres` is the length of the unit, one if it
/// is not known. Returns how many they are.
///
/// # Errors
/// [`Error::Setting`] if they take 4 GiB, which no such file holds; what writing gives.
pub fn write_glb(source: GaussianSource<'_>, metres: Option<f64>, path: &Path) -> Result<u64> {
    let mut points = PointBounds { count: 0, low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };
    source.each(|gaussian| points.add(gaussian.centre))?;
    let head = points.head(metres.unwrap_or(1.0)).ok_or_else(|| {
        let what = format!("{}: a GLB file cannot hold the 4 GiB of {} splats", path.display(), points.count);
        Error::setting(what, "write .ply, or choose a larger `error` or a coarser `level`")
    })?;
    let mut file = PartFile::create(path)?;
    file.append(&head)?;
    source.append(&mut file, point)?;
    file.finish()?;
    Ok(points.count)
}

/// How many points there are, and where.
struct PointBounds {
    count: u64,
    low: [f32; 3],
    high: [f32; 3],
}

impl PointBounds {
    fn add(&mut self, at: [f32; 3]) {
        self.count += 1;
        self.low = std::array::from_fn(|a| self.low[a].min(at[a]));
        self.high = std::array::from_fn(|a| self.high[a].max(at[a]));
    }

    /// All that stands before the points; `None` if the file would be too large.
    fn head(&self, metres: f64) -> Option<Vec<u8>> {
        let data = self.count.checked_mul(POINT_BYTES)?;
        let mut json = self.json(metres).into_bytes();
        // Chunks end at multiples of four bytes.
        json.resize(json.len().next_multiple_of(4), b' ');
        let chunk = if self.count == 0 { 0 } else { CHUNK_BYTES + data };
        let total = u32::try_from((HEAD_BYTES + CHUNK_BYTES + json.len() as u64).checked_add(chunk)?).ok()?;
        let mut head = b"glTF".to_vec();
        for number in [2, total, json.len() as u32] {
            head.extend(number.to_le_bytes());
        }
        head.extend(b"JSON");
        head.extend(json);
        if self.count > 0 {
            head.extend((data as u32).to_le_bytes());
            head.extend(b"BIN\0");
        }
        Some(head)
    }

    fn json(&self, metres: f64) -> String {
        let asset = r#""asset":{"version":"2.0","generator":"Brickfield"},"scene":0"#;
        let count = self.count;
        if count == 0 {
            // Without anything in it glTF knows no mesh.
            return format!(r#"{{{asset},"scenes":[{{}}]}}"#);
        }
        // With an exponent, or small numbers would take a line of zeros.
        let [low, high] = [self.low, self.high].map(|at| at.map(|c| format!("{:e}", f64::from(c))).join(","));
        let (mut names, mut accessors, mut offset) = (Vec::new(), Vec::new(), 0);
        for (number, (name, kind, component, bytes)) in ATTRIBUTES.into_iter().enumerate() {
            names.push(format!(r#""{name}":{number}"#));
            let more = match name {
                "POSITION" => format!(r#","min":[{low}],"max":[{high}]"#),
                "COLOR_0" => r#","normalized":true"#.to_owned(),
                _ => String::new(),
            };
            accessors.push(format!(
                r#"{{"bufferView":0,"byteOffset":{offset},"componentType":{component},"count":{count},"type":"{kind}"{more}}}"#
            ));
            offset += bytes;
        }
        let data = count * POINT_BYTES;
        [
            format!(r#"{{{asset},"extensionsUsed":["KHR_gaussian_splatting"],"scenes":[{{"nodes":[0]}}],"#),
            format!(
                r#""nodes":[{{"mesh":0,"matrix":[{metres:e},0,0,0,0,0,-{metres:e},0,0,{metres:e},0,0,0,0,0,1]}}],"#
            ),
            format!(r#""meshes":[{{"primitives":[{{"mode":0,"attributes":{{{}}},"#, names.join(",")),
            r#""extensions":{"KHR_gaussian_splatting":{"kernel":"ellipse","colorSpace":"srgb_rec709_display"}}}]}],"#
                .to_owned(),
            format!(r#""accessors":[{}],"#, accessors.join(",")),
            format!(
                r#""bufferViews":[{{"buffer":0,"byteLength":{data},"byteStride":{POINT_BYTES},"target":34962}}],"#
            ),
            format!(r#""buffers":[{{"byteLength":{data}}}]}}"#),
        ]
        .concat()
    }
}

/// The bytes of a point, in the order of [`ATTRIBUTES`].
fn point(gaussian: &Gaussian) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(POINT_BYTES as usize);
    let floats = |bytes: &mut Vec<u8>, numbers: &[f32]| {
        numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    };
    floats(&mut bytes, &gaussian.centre);
    let byte = |part: f64| (part.clamp(0.0, 1.0) * 255.0).round() as u8;
    bytes.extend([byte(linear(gaussian.grey)); 3]);
    bytes.push(byte(OPACITY));
    floats(&mut bytes, &gaussian.deviations.map(|deviation| deviation as f32));
    let [w, i, j, k] = gaussian.turn;
    floats(&mut bytes, &[i, j, k, w, OPACITY as f32]);
    floats(&mut bytes, &[gaussian.harmonic(); 3]);
    bytes
}

/// The light of a grey that screens show (IEC 61966-2-1), as glTF has colours of points.
fn linear(grey: f64) -> f64 {
    if grey <= 0.040_45 { grey / 12.92 } else { libm::pow((grey + 0.055) / 1.055, 2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splats::Disc;

    #[test]
    fn bytes_of_a_point_are_those_of_its_attributes() {
        let disc = Disc {
            centre: [1.0, 2.0, 3.0],
            normal: [0.0, 0.0, 1.0],
            radius: 4.0,
            cell_centre: [1.0, 2.0, 3.0],
            cell: 2.0,
            cuts: Vec::new(),
        };
        let bytes = point(&Gaussian::of(&disc));
        assert_eq!(
            (bytes.len() as u64, ATTRIBUTES.iter().map(|(.., bytes)| bytes).sum()),
            (POINT_BYTES, POINT_BYTES)
        );
        let number = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!([0, 4, 8].map(number), [1.0, 2.0, 3.0]);
        assert_eq!([16, 20, 24].map(number), [2.0, 2.0, 0.1]);
        assert_eq!([28, 32, 36, 40, 44].map(number), [0.0, 0.0, 0.0, 1.0, 0.99]);
        assert!((f64::from(number(48)) * 0.282_094_79 + 0.5 - 0.92).abs() < 1e-6);
        assert_eq!(bytes[12..16], [211, 211, 211, 252]);
    }

    #[test]
    fn files_beyond_four_gibibytes_are_refused() {
        let of = |count| PointBounds { count, low: [-1.0; 3], high: [1.0; 3] };
        let most = u64::from(u32::MAX) / POINT_BYTES;
        assert!(of(most).head(0.001).is_none() && of(u64::MAX).head(0.001).is_none());
        let head = of(most - 100).head(0.001).unwrap();
        assert_eq!(head[8..12], (head.len() as u32 + ((most - 100) * POINT_BYTES) as u32).to_le_bytes());
        assert!(head.len() < 4096 && head.len().is_multiple_of(4));
        // Nothing at all is no mesh, but a file.
        let empty = of(0).head(1.0).unwrap();
        assert_eq!(
            (empty[8..12].to_vec(), &empty[16..20]),
            ((empty.len() as u32).to_le_bytes().to_vec(), &b"JSON"[..])
        );
        assert!(!String::from_utf8(empty[20..].to_vec()).unwrap().contains("mesh"));
    }
}
