//! Laws of any sweep: closed where it should be, and the same however it is read.

use super::*;
use proptest::prelude::*;
use std::fmt::Write;

fn text<const N: usize>(values: &[[f64; N]]) -> String {
    values.as_flattened().iter().fold(String::new(), |mut text, v| {
        write!(text, "{v} ").unwrap();
        text
    })
}

/// Points of few distinct coordinates, so that collinear runs, reversals and repeated points abound.
fn points<const N: usize>(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<[f64; N]>> {
    let coordinate = prop_oneof![Just(0.0), Just(1.0), Just(-1.5), -3.0..3.0f64];
    prop::collection::vec(prop::collection::vec(coordinate, N), count)
        .prop_map(|points| points.into_iter().map(|p| p.try_into().unwrap()).collect())
}

/// Attributes of a sweep with caps and a closed outline.
fn capped() -> impl Strategy<Value = String> {
    let ends_meet = any::<bool>();
    (points::<2>(2..9), points::<3>(2..9), ends_meet, any::<bool>(), any::<bool>(), 0.1..2.0f64).prop_map(
        |(mut outline, mut spine, ends_meet, scaled, turned, size)| {
            outline.push(outline[0]);
            if ends_meet {
                spine.push(spine[0]);
            }
            let mut attributes = format!("crossSection='{}' spine='{}'", text(&outline), text(&spine));
            if scaled {
                let scale: Vec<[f64; 2]> = (0..spine.len()).map(|i| [size + i as f64, size]).collect();
                write!(attributes, " scale='{}'", text(&scale)).unwrap();
            }
            if turned {
                let turns: Vec<[f64; 4]> =
                    (0..spine.len()).map(|i| [size, 1.0, 0.0, size * i as f64]).collect();
                write!(attributes, " orientation='{}'", text(&turns)).unwrap();
            }
            attributes
        },
    )
}

proptest! {
    #[test]
    fn capped_sweeps_are_closed_wherever_they_stand(attributes in capped(), turn in -3.0..3.0f64) {
        let scene = format!(
            "<Transform translation='0.1 7 1e3' rotation='1 2 3 {turn}' scale='1 -0.3 2'>\
             <Shape><Extrusion {attributes}/></Shape></Transform>"
        );
        let Ok(sweeps) = opened(&file(&scene)) else { return Ok(()) };
        let triangles = all(&sweeps);
        prop_assert!(triangles.iter().flatten().flatten().all(|c| c.is_finite()));
        prop_assert_eq!(open_edges(&triangles), 0, "{}", scene);
    }

    #[test]
    fn ranges_do_not_show(attributes in prop::collection::vec(capped(), 1..4), cuts in prop::collection::vec(0.0..1.0f64, 0..9)) {
        let mut scene = String::new();
        for (i, attributes) in attributes.iter().enumerate() {
            write!(scene, "<Shape><Extrusion DEF='e{i}' {attributes}/></Shape><Shape><Extrusion USE='e0'/></Shape>")
                .unwrap();
        }
        let Ok(sweeps) = opened(&file(&scene)) else { return Ok(()) };
        let whole = all(&sweeps);
        let mut ends: Vec<u64> = cuts.iter().map(|c| (c * whole.len() as f64) as u64).collect();
        ends.push(whole.len() as u64 + 5);
        ends.sort();
        let (mut parts, mut from) = (Vec::new(), 0);
        for to in ends {
            sweeps.append(from..to, &mut parts);
            from = to;
        }
        prop_assert_eq!(parts, whole);
    }
}

#[test]
fn single_triangles_are_those_of_the_whole() {
    let sweeps = sweeps(
        "<Shape><Extrusion spine='0 0 0, 0 1 0, 1 2 0, 5 5 5'/></Shape>\
         <Shape><Extrusion beginCap='false' ccw='false' spine='9 9 9, 0 1 0'/></Shape>",
    );
    let whole = all(&sweeps);
    assert_eq!(whole.len(), 28 + 10);
    for (i, triangle) in whole.iter().enumerate() {
        let mut one = Vec::new();
        sweeps.append(i as u64..i as u64 + 1, &mut one);
        assert_eq!(one, [*triangle]);
    }
}

#[test]
fn closed_spines_without_caps_are_closed() {
    let ring = "0 0 0, 4 0 0, 5 3 1, 0 4 0, 0 0 0";
    let sweeps = sweeps(&format!(
        "<Shape><Extrusion beginCap='false' endCap='false' spine='{ring}' crossSection='.2 .1 .2 -.1 -.2 -.1 .2 .1'/></Shape>"
    ));
    assert_eq!(open_edges(&all(&sweeps)), 0);
}

#[test]
fn hollow_outlines_have_proper_caps() {
    // A "U": a fan from its first corner would cover the notch twice.
    let outline = "1 0, 3 0, 3 3, 2 3, 2 1, 1 1, 1 3, 0 3, 0 0, 1 0";
    let sweeps = sweeps(&format!("<Shape><Extrusion crossSection='{outline}' ccw='false'/></Shape>"));
    let triangles = all(&sweeps);
    let caps: f64 = triangles[18..].iter().map(area).sum();
    assert!((volume(&triangles) - 7.0).abs() < 1e-12, "{}", volume(&triangles));
    assert!((caps - 14.0).abs() < 1e-12 && open_edges(&triangles) == 0, "{caps}");
}
