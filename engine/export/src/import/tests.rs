//! Files that were damaged are refused in one line, or read within their bounds.

use super::{Grid, Reading, build_volume};
use crate::lattice::mix;
use crate::progress::Silent;

/// Opens damaged copies of a file and reads all samples of those that are taken.
fn damaged(name: &str, bytes: &[u8], head: usize) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let description = "{\"origin\": [0, 0, 0], \"spacing\": 1, \"unit\": \"mm\"}";
    std::fs::write(path.with_extension("json"), description).unwrap();
    let mut taken = 0;
    for seed in 0..400u64 {
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
        match Grid::open(&path) {
            Ok(grid) => {
                let [x, y, z] = grid.shape();
                assert!(x * y * z <= copy.len());
                let output = folder.path().join("o.brf");
                let files = (&*path, &*output);
                let built = build_volume(&grid, files, Some(Reading::Winding), ("mm", "test"), &Silent);
                let _ = built.inspect_err(|error| assert!(!error.to_string().contains('\n')));
                let _ = std::fs::remove_file(output);
                taken += 1;
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
    damaged("a.npy", &bytes, 80);
}

#[test]
fn damaged_images() {
    let header = "ObjectType = Image\nNDims = 3\nCompressedData = False\nOffset = 1 2 3\nElementSpacing = 1 1 1\n\
                  DimSize = 5 4 3\nElementType = MET_SHORT\nElementDataFile = LOCAL\n";
    let bytes = [header.as_bytes(), &samples()].concat();
    damaged("a.mha", &bytes, header.len());
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
    let built =
        build_volume(&Grid::open(&input).unwrap(), (&input, &output), None, ("mm", "test"), &Silent).unwrap();
    assert_eq!((built.depth, built.is_cut), (12, false));
    let bricks = long.div_ceil(32) as u64;
    assert!(built.stats.nodes > bricks && built.stats.nodes < 20 * bricks, "{:?}", built.stats);
}
