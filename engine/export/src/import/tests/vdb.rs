//! OpenVDB grids: every kind of node that the library writes, by it and by a writer of these tests.

use super::{data, opened, values_of};
use crate::import::Grid;

fn number([x, y, z]: [i64; 3]) -> f64 {
    ((x * 31 + y * 17 + z * 7) % 101) as f64 / 8.0
}

/// What `make.py` has at a voxel.
fn wanted(voxel @ [x, y, z]: [i64; 3]) -> f64 {
    let within = |low: [i64; 3], size: i64| (0..3).all(|a| (low[a]..low[a] + size).contains(&voxel[a]));
    if within([0, 64, 0], 16) {
        return 4.0;
    }
    if within([64, 64, 0], 8) {
        return 6.0;
    }
    if within([128, 0, 0], 128) {
        return 1.5;
    }
    if !(within([0, 0, 0], 56) && y < 8 && z < 8) {
        return 3.0;
    }
    if (x + y + z) % 2 == 0 {
        return number(voxel);
    }
    let pick = |values: &[f64]| values[y as usize % values.len()];
    match x / 8 {
        0 => 3.0,
        1 => -3.0,
        2 => 5.0,
        3 => pick(&[3.0, -3.0]),
        4 => pick(&[3.0, 5.0]),
        5 => pick(&[5.0, 7.0]),
        _ => pick(&[5.0, 7.0, 9.0]),
    }
}

/// Compares all samples with the formula; `shift` is where the pattern begins.
fn compare(grid: &Grid, shift: [i64; 3], step: f64) {
    let first: [i64; 3] = std::array::from_fn(|a| (grid.origin()[a] / step).round() as i64);
    let high = grid.shape();
    let mut kinds = 0;
    for (low, high) in [([0; 3], [100, 82.min(high[1]), 18]), ([high[0] - 40, 0, 0], [high[0], 40, 40])] {
        for (at, value) in values_of(grid, [low, high]) {
            let voxel: [i64; 3] = std::array::from_fn(|a| first[a] + at[a] as i64 - shift[a]);
            assert_eq!(value, wanted(voxel), "{voxel:?}");
            kinds += i32::from(value != 3.0);
        }
    }
    assert!(kinds > 2000, "{kinds}");
    let uniform = |low: [i64; 3], size: i64| {
        let low: [usize; 3] = std::array::from_fn(|a| (low[a] + shift[a] - first[a]) as usize);
        grid.uniform([low, low.map(|c| c + size as usize)])
    };
    assert_eq!(uniform([130, 2, 2], 33), Some(1.5));
    assert_eq!(uniform([0, 0, 0], 33), None);
    assert_eq!(uniform([112, 0, 0], 33), None);
}

#[test]
fn all_kinds_of_nodes_are_read() {
    for (name, shift) in [("codes", [0; 3]), ("halves", [0; 3]), ("below", [-256, -4096, 4096])] {
        let grid = opened(&data("codes.vdb"), Some(name));
        assert!(grid.shape().iter().all(|&n| n < 400), "{:?}", grid.shape());
        assert!(grid.fields()[0].starts_with(name) && grid.fields().len() == 3);
        compare(&grid, shift, 1.0);
    }
}

#[test]
fn grids_have_a_class_and_a_place() {
    let grid = opened(&data("grids.vdb"), None);
    assert_eq!((grid.fields()[0].as_str(), grid.spacing()), ("ball: float, level set", 0.5));
    assert!(grid.holds_distances() && grid.type_name() == "<f4");
    let mut near = 0;
    for (at, value) in values_of(&grid, [[0; 3], grid.shape()]) {
        let world: [f64; 3] = std::array::from_fn(|a| grid.origin()[a] + 0.5 * at[a] as f64);
        let off = [world[0] - 1.0, world[1] - 2.0, world[2] - 3.0];
        let distance = off.iter().map(|c| c * c).sum::<f64>().sqrt() - 2.0;
        assert!((value - distance.clamp(-1.5, 1.5)).abs() < 1e-5, "{value} {distance}");
        near += i32::from(distance.abs() < 1.5);
    }
    assert!(near > 500);
    let grid = opened(&data("grids.vdb"), Some("fog"));
    assert!(!grid.holds_distances());
    for (at, value) in values_of(&grid, [[0; 3], grid.shape()]) {
        let world: [f64; 3] = std::array::from_fn(|a| grid.origin()[a] + 0.5 * at[a] as f64);
        let voxel = [(world[0] - 1.0) / 0.5, (world[1] - 2.0) / 0.5, (world[2] - 3.0) / 0.5];
        let inside = (0..3).all(|a| (3 + a as i64..=[20, 12, 30][a]).contains(&(voxel[a] as i64)));
        assert_eq!(value, f64::from(u8::from(inside)), "{voxel:?}");
    }
    for (name, what) in [
        ("vectors", "grid vectors is of the type Tree_vec3s_5_4_3"),
        ("turned", "turned or skewed"),
        ("flat", "1, 1 and 2 apart"),
        ("none", "holds no grid \"none\", but ball: float, level set;"),
        ("", "nothing but its background"),
    ] {
        let error = Grid::open(&data("grids.vdb"), Some(name)).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(what) && !error.contains('\n'), "{error}");
    }
}

/// Bits of a grid's compression.
const ZIP: u32 = 1;
const MASK: u32 = 2;

/// A file with one grid of doubles: a root tile of 7 at [4096, 0, 0], and a leaf at [8, 16, 24] whose voxel `[x, y, z]` has the
/// value 64·x + 8·y + z where it is even, and where not 5.
fn written(compression: u32, map: &str, numbers: &[f64], version: u32) -> Vec<u8> {
    let mut file = Vec::new();
    let text = |out: &mut Vec<u8>, text: &str| {
        out.extend((text.len() as u32).to_le_bytes());
        out.extend(text.bytes());
    };
    file.extend(0x5644_4220u64.to_le_bytes());
    [version, 10, 0].iter().for_each(|n: &u32| file.extend(n.to_le_bytes()));
    file.push(1);
    file.extend([b'0'; 36]);
    file.extend(0u32.to_le_bytes());
    file.extend(1u32.to_le_bytes());
    text(&mut file, "twice\u{1e}1");
    text(&mut file, "Tree_double_5_4_3");
    text(&mut file, "");
    let offsets = file.len();
    file.extend([0; 24]);
    let grid_at = file.len() as u64;
    file.extend(compression.to_le_bytes());
    file.extend(0u32.to_le_bytes());
    text(&mut file, map);
    numbers.iter().for_each(|n| file.extend(n.to_le_bytes()));
    file.extend(1u32.to_le_bytes());
    file.extend(0f64.to_le_bytes());
    [1u32, 1].iter().for_each(|n| file.extend(n.to_le_bytes()));
    [4096i32, 0, 0].iter().for_each(|n| file.extend(n.to_le_bytes()));
    file.extend(7f64.to_le_bytes());
    file.push(0);
    [0i32; 3].iter().for_each(|n| file.extend(n.to_le_bytes()));
    let values = |out: &mut Vec<u8>, code: u8, inactive: &[f64], values: &[f64]| {
        out.push(code);
        inactive.iter().for_each(|n| out.extend(n.to_le_bytes()));
        let bytes: Vec<u8> = values.iter().flat_map(|n| n.to_le_bytes()).collect();
        if compression & ZIP != 0 {
            let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
            std::io::Write::write_all(&mut encoder, &bytes).unwrap();
            let packed = encoder.finish().unwrap();
            let is_shorter = packed.len() < bytes.len();
            let (length, stored) =
                if is_shorter { (packed.len() as i64, packed) } else { (-(bytes.len() as i64), bytes) };
            out.extend(length.to_le_bytes());
            out.extend(stored);
        } else {
            out.extend(bytes);
        }
    };
    for (bytes, place, count) in [(4096, 0, 32768), (512, 1 << 8 | 2 << 4 | 3, 4096)] {
        let mut mask = vec![0u8; bytes];
        mask[place / 8] |= 1 << (place % 8);
        file.extend(&mask);
        file.extend(vec![0; bytes]);
        if compression & MASK != 0 {
            values(&mut file, 0, &[], &[]);
        } else {
            values(&mut file, 6, &[], &vec![0.0; count]);
        }
    }
    let mask = [0b0101_0101u8; 64];
    file.extend(mask);
    let voxels_at = file.len() as u64;
    file.extend(mask);
    if compression & MASK != 0 {
        let active: Vec<f64> = (0..256).map(|n| f64::from(2 * n)).collect();
        values(&mut file, 2, &[5.0], &active);
    } else {
        let all: Vec<f64> = (0..512).map(|n| if n % 2 == 0 { f64::from(n) } else { 5.0 }).collect();
        values(&mut file, 6, &[], &all);
    }
    let places = [grid_at, voxels_at, file.len() as u64].map(u64::to_le_bytes).concat();
    file[offsets..offsets + 24].copy_from_slice(&places);
    file
}

#[test]
fn all_compressions_maps_and_versions_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vdb");
    let scales = |first: &[f64]| [first, &[0.0; 12]].concat();
    let affine = [2.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 10.0, 20.0, 30.0, 1.0];
    let maps = [
        ("UniformScaleMap", scales(&[2.0; 3]), 2.0, [0.0; 3]),
        ("ScaleMap", scales(&[2.0; 3]), 2.0, [0.0; 3]),
        ("ScaleTranslateMap", scales(&[10.0, 20.0, 30.0, 2.0, 2.0, 2.0]), 2.0, [10.0, 20.0, 30.0]),
        ("UniformScaleTranslateMap", scales(&[10.0, 20.0, 30.0, 2.0, 2.0, 2.0]), 2.0, [10.0, 20.0, 30.0]),
        ("TranslationMap", vec![10.0, 20.0, 30.0], 1.0, [10.0, 20.0, 30.0]),
        ("AffineMap", affine.to_vec(), 2.0, [10.0, 20.0, 30.0]),
    ];
    for (n, (map, numbers, step, origin)) in maps.into_iter().enumerate() {
        for compression in 0..4 {
            std::fs::write(&path, written(compression, map, &numbers, 222 + n as u32 % 4)).unwrap();
            let grid = opened(&path, Some("twice"));
            assert_eq!((grid.spacing(), grid.origin(), grid.type_name()), (step, origin, "<f8"), "{map}");
            assert_eq!(grid.shape(), [8192, 4096, 4096]);
            for ([x, y, z], value) in values_of(&grid, [[6, 12, 20], [20, 26, 34]]) {
                let inside = (8..16).contains(&x) && (16..24).contains(&y) && (24..32).contains(&z);
                let place = if inside { 64 * (x - 8) + 8 * (y - 16) + z - 24 } else { 0 };
                let wanted = if inside && place % 2 == 1 { 5.0 } else { place as f64 };
                assert_eq!(value, wanted, "{map} {compression} at {x} {y} {z}");
            }
            assert_eq!(grid.uniform([[4100, 4000, 4000], [4133, 4033, 4033]]), Some(7.0));
            assert_eq!(grid.uniform([[4080, 4000, 4000], [4113, 4033, 4033]]), None);
            assert_eq!(grid.uniform([[140, 4000, 4000], [173, 4033, 4033]]), Some(0.0));
        }
    }
}
