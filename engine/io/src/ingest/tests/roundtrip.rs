//! Any mesh written in any format reads back the same.

use super::*;
use proptest::prelude::*;
use std::collections::BTreeMap;

fn meshes() -> impl Strategy<Value = Mesh> {
    let coordinate = prop_oneof![
        -1e3f32..1e3,
        any::<i16>().prop_map(f32::from),
        any::<f32>().prop_filter("finite", |c| c.is_finite()),
    ];
    let vertices = prop::collection::vec(prop::array::uniform3(coordinate), 1..20);
    vertices.prop_flat_map(|vertices| {
        let face = prop::collection::vec(0..vertices.len() as u32, 3..9);
        (Just(vertices), prop::collection::vec(face, 1..20))
            .prop_map(|(vertices, faces)| Mesh { vertices, faces })
    })
}

/// Directed edges minus reversed ones, by the bits of their ends: what is left is the boundary.
fn boundary(facets: &[Facet]) -> BTreeMap<[[u64; 3]; 2], i32> {
    let mut edges = BTreeMap::new();
    for facet in facets {
        let corners = facet.map(|corner| corner.map(f64::to_bits));
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            *edges.entry([a, b]).or_default() += 1;
            *edges.entry([b, a]).or_default() -= 1;
        }
    }
    edges.retain(|_, count| *count != 0);
    edges
}

proptest! {
    #[test]
    fn reads_back_what_was_written(mesh in meshes(), cut in 0u64..100, length in 0u64..100) {
        let folder = Folder::new();
        let fans = mesh.facets();
        let divided = all(&folder.open("mesh.obj", &mesh.obj()).unwrap());
        prop_assert_eq!(divided.len(), fans.len());
        prop_assert_eq!(boundary(&divided), boundary(&fans));
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for corner in fans.as_flattened() {
            for axis in 0..3 {
                low[axis] = low[axis].min(corner[axis]);
                high[axis] = high[axis].max(corner[axis]);
            }
        }
        for (ending, format, bytes) in mesh.files() {
            let input = folder.open(&format!("mesh.{ending}"), &bytes).unwrap();
            // STL has no polygons.
            let facets = if ending == "stl" { &fans } else { &divided };
            prop_assert_eq!(input.describe(), format);
            prop_assert_eq!(input.bytes(), bytes.len() as u64);
            prop_assert_eq!(input.skipped_faces(), 0);
            prop_assert_eq!(&all(&input), facets, "{}", format);
            prop_assert_eq!(input.bounds(&Silent).unwrap(), (low, high), "{}", format);

            let mut part = vec![[[7.0; 3]; 3]; 5];
            input.read(cut..cut + length, &mut part);
            let n = facets.len();
            prop_assert_eq!(&part, &facets[(cut as usize).min(n)..((cut + length) as usize).min(n)]);

            // The content alone says which format it is.
            for name in ["mesh", "mesh.stl", "mesh.obj", "mesh.ply", "mesh.txt"] {
                prop_assert_eq!(folder.open(name, &bytes).unwrap().describe(), format);
            }
        }
    }

    #[test]
    fn first_bad_facet_is_named(
        n in 1usize..200_000, bad in prop::collection::vec((0usize..200_000, 0usize..9), 1..4), which in 0usize..3
    ) {
        let value = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][which];
        let mut bytes = vec![0; 84 + 50 * n];
        bytes[80..84].copy_from_slice(&(n as u32).to_le_bytes());
        let bad: Vec<_> = bad.into_iter().map(|(facet, float)| (facet % n, float)).collect();
        for (facet, float) in &bad {
            bytes[84 + 50 * facet + 12 + 4 * float..][..4].copy_from_slice(&value.to_le_bytes());
        }
        let first = bad.iter().map(|(facet, _)| facet).min().unwrap();
        let input = Folder::new().open("a.stl", &bytes).unwrap();
        let text = input.bounds(&Silent).unwrap_err().to_string();
        prop_assert!(text.contains(&format!(": facet {}: ", first + 1)), "{text}");
    }
}
