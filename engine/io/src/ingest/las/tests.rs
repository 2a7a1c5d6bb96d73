//! Files written by laspy 2.7 with lazrs 0.8, the COPC one by copclib 2.6; damage of all kinds.

use super::*;
use crate::large_array::ArrayRoom;
use crate::progress::Silent;
use brickfield_core::sweep::part_or_all;

/// The points that the files hold: a skin of a cylinder.
fn truth(count: usize) -> Vec<[f64; 6]> {
    let point = |i: usize| {
        let angle = i as f64 * 2.399963;
        let (sin, cos) = angle.sin_cos();
        let z = 0.5 + 4.0 * (i as f64 + 0.5) / count as f64;
        [10.0 + 3.0 * cos, 20.0 + 3.0 * sin, z, cos, sin, 0.0]
    };
    (0..count).map(point).collect()
}

fn seed(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/seeds/las");
    std::fs::read(folder.join(name)).expect("a seed")
}

fn open(bytes: &[u8]) -> Result<(PointCloud, CloudColumns)> {
    read(Path::new("a.las"), bytes, &ArrayRoom::unbounded(), &Silent)
}

/// Compares a file with what its writer was given, but for the points withheld.
fn check(name: &str, count: usize, withheld: &[usize], has_normals: bool) {
    let (cloud, columns) = open(&seed(name)).unwrap_or_else(|error| panic!("{error}"));
    let kept = truth(count).into_iter().enumerate().filter(|(n, _)| !withheld.contains(n));
    let kept: Vec<[f64; 6]> = kept.map(|(_, point)| point).collect();
    assert_eq!(cloud.points.len(), kept.len(), "{name}");
    assert_eq!(cloud.normals.len(), if has_normals { kept.len() } else { 0 }, "{name}");
    assert_eq!(columns.notes.len(), usize::from(!withheld.is_empty()), "{name}");
    assert_eq!(columns.no_normals.is_none(), has_normals);
    for (n, truth) in kept.iter().enumerate() {
        // Steps of 0.001.
        assert!((0..3).all(|a| (cloud.points[n][a] - truth[a]).abs() < 0.000_51), "{name}: point {n}");
        let normal = cloud.normals.get(n).copied().unwrap_or([truth[3], truth[4], truth[5]]);
        assert!((0..3).all(|a| (normal[a] - truth[3 + a]).abs() < 1e-6), "{name}: normal {n}");
    }
}

#[test]
fn records_are_read() {
    check("points0.las", 60, &[], false);
    check("points6.las", 60, &[3], true);
}

/// Reads a file with each of some changes, none of which may be anything but points or one line.
fn damaged(name: &str, changes: impl Iterator<Item = Vec<u8>>) -> usize {
    let mut refused = 0;
    for bytes in changes {
        if let Err(error) = open(&bytes) {
            assert!(!error.to_string().contains('\n'), "{name}: {error}");
            refused += 1;
        }
    }
    refused
}

fn damage(name: &str) {
    let bytes = seed(name);
    let places = || (0..bytes.len()).step_by(part_or_all(13, 1));
    let cuts = damaged(name, places().map(|length| bytes[..length].to_vec()));
    assert!(2 * cuts > places().count(), "{name}: {cuts} cuts are refused");
    let flip = |at: usize, bit: usize| {
        let mut bytes = bytes.clone();
        bytes[at] ^= 1 << bit;
        bytes
    };
    damaged(name, places().map(|at| flip(at, at % 8)));
}

#[test]
fn damaged_records_are_told() {
    damage("points0.las");
    damage("points6.las");
    let told = |change: fn(&mut Vec<u8>), what: &str| {
        let mut bytes = seed("points0.las");
        change(&mut bytes);
        let error = open(&bytes).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    };
    told(|bytes| bytes.truncate(bytes.len() - 1), "counts 60 points of 20 bytes");
    told(|bytes| bytes.truncate(200), "ends within its header");
    told(|bytes| bytes[104] = 11, "format 11");
    told(|bytes| bytes[105] = 19, "in 19 bytes, not 20");
    told(|bytes| bytes[131..139].fill(0), "are no numbers");
    told(|bytes| bytes[107..111].fill(0xff), "counts 4294967295 points");
}

#[cfg(feature = "las")]
mod of_packed {
    use super::*;

    #[test]
    fn packed_points_are_read() {
        check("points1.laz", 300, &[], false);
        check("points3.laz", 120, &[], true);
        check("points7.laz", 300, &[0, 5], false);
        check("points6n.laz", 200, &[], true);
        check("points8.laz", 100, &[], false);
        check("points6.copc.laz", 150, &[], false);
    }

    #[test]
    fn damaged_packed_points_are_told() {
        ["points1.laz", "points3.laz", "points7.laz", "points6n.laz", "points6.copc.laz"]
            .into_iter()
            .for_each(damage);
    }

    #[test]
    fn counts_of_the_file_are_not_believed() {
        let mut bytes = seed("points1.laz");
        bytes[107..111].fill(0xff);
        let error = open(&bytes).unwrap_err().to_string();
        assert!(error.contains("counts 4294967295 points"), "{error}");
        // The number of chunks, behind the place of their table.
        let mut bytes = seed("points7.laz");
        let at = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
        let table = u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
        bytes[table + 4..table + 8].fill(0xff);
        assert!(open(&bytes).unwrap_err().to_string().contains("table of its chunks"));
    }
}

#[cfg(not(feature = "las"))]
#[test]
fn a_program_that_cannot_unpack_says_so() {
    let error = open(&seed("points1.laz")).unwrap_err().to_string();
    assert!(error.contains("the feature `las`"), "{error}");
}
