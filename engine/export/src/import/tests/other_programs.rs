//! VTK images and MetaImage.

use super::{data, opened, values_of};

/// Text, base64 and bytes, packed or not, of all types.
#[test]
fn images_of_vtk_are_read_however_they_are_written() {
    let kinds = [
        ("ascii", "<f4"),
        ("inline", "<f8"),
        ("inline_zlib", "<i8"),
        ("appended", "<i2"),
        ("appended_zlib", "<f4"),
        ("appended_base64", "u1"),
        ("appended_base64_zlib", "<u4"),
        ("cells", "<f4"),
    ];
    for (name, kind) in kinds {
        for (field, more) in [(None, 0.0), (Some("w"), 0.0), (Some("other"), 1.0)] {
            let grid = opened(&data(&format!("{name}.vti")), field);
            assert_eq!((grid.shape(), grid.spacing(), grid.type_name()), ([7, 5, 4], 0.5, kind), "{name}");
            let half = if name == "cells" { 0.25 } else { 0.0 };
            assert_eq!(grid.origin(), [11.0 + half, 19.5 + half, 30.0 + half]);
            assert_eq!((grid.note().is_some(), grid.fields().len()), (name == "cells", 3), "{name}");
            let shift = match kind.as_bytes() {
                [.., b'f', _] => 0.25 - 2.0,
                [.., b'i', _] => -2.0,
                _ => 0.0,
            };
            for (low, high) in [([0; 3], [7, 5, 4]), ([2, 1, 1], [6, 2, 4])] {
                for ([x, y, z], value) in values_of(&grid, [low, high]) {
                    let wanted = ((x * 7 + y * 5 + z * 3) % 11) as f64 + shift + more;
                    assert_eq!(value, wanted, "{name} {field:?} at {x} {y} {z}");
                }
            }
        }
    }
}

#[test]
fn packed_images_of_itk_are_read() {
    for name in ["packed.mha", "packed.mhd"] {
        let grid = opened(&data(name), None);
        assert_eq!((grid.shape(), grid.spacing(), grid.origin()), ([7, 5, 4], 0.5, [11.0, 19.5, 30.0]));
        for ([x, y, z], value) in values_of(&grid, [[0; 3], [7, 5, 4]]) {
            assert_eq!(value, ((x * 7 + y * 5 + z * 3) % 11) as f64 - 2.0, "{name}");
        }
    }
}
