//! Files that were damaged are refused in one line, or read within their bounds.

use super::data;
use crate::import::{Grid, Reading, build_volume};
use crate::lattice::mix;
use crate::progress::Silent;

/// Larger volumes are opened and not built.
const MOST_SAMPLES: usize = 1 << 18;

/// Opens damaged copies of a file and reads all samples of those that are taken. Damage is in the first `head` bytes.
fn damaged(name: &str, bytes: &[u8], head: usize, copies: u64) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let description = "{\"origin\": [0, 0, 0], \"spacing\": 1, \"unit\": \"mm\"}";
    std::fs::write(path.with_extension("json"), description).unwrap();
    let mut taken = 0;
    for seed in 0..copies {
        let mut copy = bytes.to_vec();
        for n in 0..1 + seed % 3 {
            let random = mix(seed * 8 + n);
            let at = random as usize % head;
            copy[at] = match random >> 60 {
                0..8 => (random >> 32) as u8,
                8..12 => b"0123456789-., ='\n"[(random >> 40) as usize % 17],
                _ => copy[at] ^ 1 << (random >> 40 & 7),
            };
        }
        if seed % 7 == 0 {
            copy.truncate(mix(seed) as usize % copy.len());
        }
        std::fs::write(&path, &copy).unwrap();
        match Grid::open(&path, None) {
            Ok(mut grid) => {
                taken += 1;
                if grid
                    .shape()
                    .iter()
                    .try_fold(1usize, |all, &n| all.checked_mul(n))
                    .is_none_or(|n| n > MOST_SAMPLES)
                {
                    continue;
                }
                let output = folder.path().join("o.brf");
                let files = (&*path, &*output);
                let built =
                    build_volume(&mut grid, files, Some(Reading::Winding), ("mm", "test"), None, &Silent);
                let _ = built.inspect_err(|error| assert!(!error.to_string().contains('\n')));
                let _ = std::fs::remove_file(output);
            }
            Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
        }
    }
    assert!(taken > 0);
}

fn samples() -> Vec<u8> {
    (0..5 * 4 * 3u8).flat_map(|n| i16::from(n % 7 == 0).to_le_bytes()).collect()
}

#[test]
fn damaged_arrays() {
    let header = format!("{:<117}\n", "{'descr': '<i2', 'fortran_order': False, 'shape': (3, 4, 5), }");
    let mut bytes = b"\x93NUMPY\x01\0v\0".to_vec();
    bytes.extend(header.bytes());
    bytes.extend(samples());
    damaged("a.npy", &bytes, 80, 400);
}

/// Bytes of the test data.
fn file(name: &str) -> Vec<u8> {
    std::fs::read(data(name)).unwrap()
}

#[test]
fn damaged_images_of_vtk() {
    for name in ["ascii.vti", "inline_zlib.vti", "appended_zlib.vti", "appended_base64.vti", "packed.mha"] {
        let bytes = file(name);
        damaged(name, &bytes, bytes.len(), 60);
    }
}

#[test]
fn damaged_trees() {
    let bytes = file("grids.vdb");
    damaged("a.vdb", &bytes, bytes.len(), 60);
    damaged("a.vdb", &bytes, 900, 200);
}

#[test]
fn damaged_images() {
    let header = "ObjectType = Image\nNDims = 3\nCompressedData = False\nOffset = 1 2 3\nElementSpacing = 1 1 1\n\
                  DimSize = 5 4 3\nElementType = MET_SHORT\nElementDataFile = LOCAL\n";
    let bytes = [header.as_bytes(), &samples()].concat();
    damaged("a.mha", &bytes, header.len(), 400);
}

/// A cube about a long grid would have billions of bricks.
#[test]
fn long_grids_take_what_they_fill() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("a.raw"), folder.path().join("a.brf"));
    let (long, across) = (70_000usize, 4usize);
    let place = format!(
        "\"origin\": [0, 0, 0], \"spacing\": 1, \"dtype\": \"u1\", \"shape\": [{long}, {across}, {across}]"
    );
    std::fs::write(input.with_extension("json"), format!("{{{place}}}")).unwrap();
    let inner = |n: usize| [n % across, n / across % across].iter().all(|c| (1..3).contains(c));
    let is_solid = |n: usize| inner(n) && (10..long - 10).contains(&(n / across / across));
    let bytes: Vec<u8> = (0..across * across * long).map(|n| u8::from(is_solid(n))).collect();
    std::fs::write(&input, bytes).unwrap();
    let mut grid = Grid::open(&input, None).unwrap();
    let built = build_volume(&mut grid, (&input, &output), None, ("mm", "test"), None, &Silent).unwrap();
    assert_eq!((built.depth, built.is_cut), (12, false));
    let bricks = long.div_ceil(32) as u64;
    assert!(built.stats.nodes > bricks && built.stats.nodes < 20 * bricks, "{:?}", built.stats);
}
