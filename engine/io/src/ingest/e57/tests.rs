//! Files written by pye57 0.4.19, which is libE57Format; damage of all kinds.

use super::read;
use crate::error::Result;
use crate::ingest::columns::CloudColumns;
use crate::large_array::ArrayRoom;
use crate::progress::Silent;
use crate::soup::PointCloud;
use e57::{
    E57Writer, Extension, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform, Translation,
};
use std::io::Cursor;
use std::path::Path;

/// The points that the files hold, in metres: a skin of a cylinder.
fn truth(count: usize) -> Vec<[f64; 3]> {
    let point = |i: usize| {
        let (sin, cos) = (i as f64 * 2.399963).sin_cos();
        [10.0 + 3.0 * cos, 20.0 + 3.0 * sin, 0.5 + 4.0 * (i as f64 + 0.5) / count as f64]
    };
    (0..count).map(point).collect()
}

/// It writes coordinates of 32 bits.
const OF_PYE57: f64 = 2e-3;

fn seed(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/seeds/e57");
    std::fs::read(folder.join(name)).expect("a seed")
}

fn open(bytes: &[u8]) -> Result<(PointCloud, CloudColumns)> {
    read(Path::new("a.e57"), bytes, &ArrayRoom::unbounded(), &Silent)
}

/// Compares millimetres with metres.
fn check(found: &[[f64; 3]], truth: &[[f64; 3]], tolerance: f64) {
    assert_eq!(found.len(), truth.len());
    for (n, (found, truth)) in found.iter().zip(truth).enumerate() {
        assert!((0..3).all(|a| (found[a] - 1000.0 * truth[a]).abs() < tolerance), "{n}: {found:?} {truth:?}");
    }
}

#[test]
fn scans_are_read_where_their_poses_place_them() {
    let (cloud, columns) = open(&seed("one.e57")).unwrap();
    check(&cloud.points, &truth(90), OF_PYE57);
    assert!(
        columns.names.contains(&"cartesianX".to_owned())
            && columns.no_normals.unwrap().contains("scan 1 of 1")
    );
    // Every third point is of one scan, whose fourth is marked as invalid.
    let all = truth(120);
    let of_scan =
        |scan: usize| all.iter().skip(scan).step_by(3).enumerate().filter(|(n, _)| *n != 3).map(|(_, p)| *p);
    let (cloud, columns) = open(&seed("posed.e57")).unwrap();
    check(&cloud.points, &(0..3).flat_map(of_scan).collect::<Vec<_>>(), OF_PYE57);
    assert!(columns.notes[0].starts_with("3 points"), "{:?}", columns.notes);
}

/// A file of the crate's own writer, for what pye57 does not write.
fn written(names: Vec<RecordName>, transform: Option<Transform>, point: &[f64]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut file = E57Writer::new(&mut bytes, "file").unwrap();
    let url = "http://www.libe57.org/E57_NOR_surface_normals.txt";
    file.register_extension(Extension::new("nor", url)).unwrap();
    let data_type = RecordDataType::Double { min: None, max: None };
    let prototype = names.into_iter().map(|name| Record { name, data_type: data_type.clone() }).collect();
    let mut scan = file.add_pointcloud("scan", prototype).unwrap();
    scan.set_transform(transform);
    scan.add_point(point.iter().copied().map(RecordValue::Double).collect()).unwrap();
    scan.finalize().unwrap();
    file.finalize().unwrap();
    drop(file);
    bytes.into_inner()
}

#[test]
fn normals_are_turned_with_their_scan() {
    let normal =
        |axis: &str| RecordName::Unknown { namespace: "nor".to_owned(), name: format!("normal{axis}") };
    use RecordName::{CartesianX, CartesianY, CartesianZ};
    let names = vec![CartesianX, CartesianY, CartesianZ, normal("X"), normal("Y"), normal("Z")];
    // A quarter turn about x: y becomes z.
    let half = 0.5f64.sqrt();
    let transform = Transform {
        rotation: Quaternion { w: half, x: half, y: 0.0, z: 0.0 },
        translation: Translation { x: 1.0, y: 0.0, z: 0.0 },
    };
    let bytes = written(names, Some(transform), &[1.0, 2.0, 3.0, 0.0, 1.0, 0.0]);
    let (cloud, columns) = open(&bytes).unwrap();
    check(&cloud.points, &[[2.0, -3.0, 2.0]], 1e-9);
    assert!(columns.no_normals.is_none());
    assert!((0..3).all(|a| (cloud.normals[0][a] - [0.0, 0.0, 1.0][a]).abs() < 1e-6), "{:?}", cloud.normals);
}

#[test]
fn ranges_and_angles_are_places() {
    use RecordName::{SphericalAzimuth, SphericalElevation, SphericalRange};
    let names = vec![SphericalRange, SphericalAzimuth, SphericalElevation];
    let (azimuth, elevation) = (0.7f64, -0.4f64);
    let bytes = written(names, None, &[5.0, azimuth, elevation]);
    let flat = 5.0 * elevation.cos();
    check(
        &open(&bytes).unwrap().0.points,
        &[[flat * azimuth.cos(), flat * azimuth.sin(), 5.0 * elevation.sin()]],
        1e-9,
    );
}

#[test]
fn damage_is_told() {
    for name in ["one.e57", "posed.e57"] {
        let bytes = seed(name);
        let refused = |bytes: &[u8]| {
            let error = open(bytes).expect_err(name).to_string();
            assert!(!error.contains('\n'), "{error}");
        };
        (0..bytes.len()).step_by(7).for_each(|length| refused(&bytes[..length]));
        // Pages have checksums, behind the header as well.
        for at in (48..bytes.len()).step_by(5) {
            let mut bytes = bytes.clone();
            bytes[at] ^= 1 << (at % 8);
            if let Err(error) = open(&bytes) {
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
}
