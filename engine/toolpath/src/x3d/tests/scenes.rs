//! Hierarchy, DEF and USE, and what is left out.

use super::*;

const CUBE: &str = "<Shape><Extrusion/></Shape>";

#[test]
fn transforms_nest() {
    let scene = format!(
        "<Transform translation='10 0 0'><Group><Transform rotation='0 0 1 1.5707963267948966' \
         scale='1 3 1'>{CUBE}</Transform></Group>{CUBE}</Transform>{CUBE}"
    );
    let sweeps = sweeps(&scene);
    let triangles = all(&sweeps);
    assert_eq!(triangles.len(), 36);
    let expected = [([7.0, -1.0, -1.0], [10.0, 1.0, 1.0]), ([9.0, 0.0, -1.0], [11.0, 1.0, 1.0])];
    for (part, (low, high)) in triangles.chunks(12).zip(expected) {
        let [found_low, found_high] = bounds(part);
        assert!((found_low - DVec3::from(low)).length() < 1e-12, "{found_low}");
        assert!((found_high - DVec3::from(high)).length() < 1e-12, "{found_high}");
    }
    let volumes: Vec<f64> = triangles.chunks(12).map(volume).collect();
    assert!(volumes.iter().zip([12.0, 4.0, 4.0]).all(|(v, e)| (v - e).abs() < 1e-9), "{volumes:?}");
}

#[test]
fn mirrored_solids_stay_solid() {
    let mirrored = all(&sweeps(&format!("<Transform scale='-1 2 1'>{CUBE}</Transform>")));
    assert_eq!((volume(&mirrored), open_edges(&mirrored)), (8.0, 0));
}

#[test]
fn uses_show_what_was_defined_where_they_stand() {
    let used = pieces(
        "<Group DEF='pair'><Transform DEF='near' translation='1 0 0'><Shape DEF='s'><Extrusion DEF='e'/></Shape>\
         </Transform><Transform translation='0 5 0'><Shape><Extrusion USE='e'/></Shape></Transform></Group>\
         <Transform translation='0 0 9'><Group USE='pair'/><Transform USE='near'/></Transform>\
         <Shape USE='s'/>",
    );
    assert_eq!(used.extrusions.len(), 1);
    let at: Vec<[f64; 3]> = used.places.iter().map(|(_, m)| m.translation.to_array()).collect();
    let expected = [
        [1.0, 0.0, 0.0],
        [0.0, 5.0, 0.0],
        [1.0, 0.0, 9.0],
        [0.0, 5.0, 9.0],
        [1.0, 0.0, 9.0],
        [0.0, 0.0, 0.0],
    ];
    assert_eq!(at, expected);
    assert_eq!((used.report.extrusions, used.report.placed), (1, 6));
    assert!(used.report.warnings().is_empty());
}

#[test]
fn names_may_be_given_again_and_must_be_known() {
    let used = pieces(
        "<Transform translation='1 0 0'><Shape DEF='a'><Extrusion/></Shape></Transform>\
         <Shape DEF='a'><Extrusion/></Shape><Shape USE='a'/>\n<Shape USE='b'/>\
         <Group DEF='c'><Shape USE='a'/><Group USE='c'/></Group><Shape DEF='empty'/><Shape USE='empty'/>",
    );
    let shown: Vec<u64> = used.places.iter().map(|place| place.0).collect();
    assert_eq!(shown, [0, 1, 1, 1]);
    let warnings = used.report.warnings();
    assert!(warnings[0].starts_with("line 4: Shape USE=\"b\": no node of that name"), "{warnings:?}");
    assert!(warnings[1].starts_with("line 4: Group USE=\"c\""), "{warnings:?}");
    assert_eq!(warnings.len(), 2);
}

#[test]
fn what_is_hidden_may_still_be_used() {
    let used = pieces(
        "<Switch><Shape DEF='a'><Extrusion/></Shape><Shape><Extrusion spine='0 0 0 0 0 1'/></Shape></Switch>\
         <Shape USE='a'/>",
    );
    assert_eq!((used.extrusions.len(), used.places.len()), (1, 1));
    for (scene, shown) in [
        (format!("<Switch whichChoice='1'>{CUBE}{CUBE}{CUBE}</Switch>"), 1),
        (format!("<Switch whichChoice='-1'>{CUBE}</Switch>"), 0),
        (format!("<Switch whichChoice='0'><MetadataSet/>{CUBE}</Switch>"), 1),
        (format!("<LOD range='10'>{CUBE}<Group>{CUBE}{CUBE}</Group></LOD>"), 1),
        (format!("<Group visible='false'>{CUBE}</Group>{CUBE}"), 1),
        (format!("<Collision>{CUBE}<Shape containerField='proxy'><Extrusion/></Shape></Collision>"), 1),
    ] {
        assert_eq!(pieces(&scene).places.len(), shown, "{scene}");
    }
}

#[test]
fn what_is_not_read_is_counted_by_name() {
    let found = pieces(&format!(
        "<Shape><Box/></Shape>\n<Shape><Box/><Appearance><Material/></Appearance></Shape>\n\
         <ProtoDeclare name='p'><ProtoBody>{CUBE}</ProtoBody></ProtoDeclare><Inline url='\"b.x3d\"'/>\
         <GeoLocation>{CUBE}</GeoLocation><Strange>{CUBE}</Strange>{CUBE}"
    ));
    let skipped: Vec<_> = found.report.skipped.into_iter().collect();
    assert_eq!(
        skipped,
        [
            ("Box", (2, 3)),
            ("Extrusion in an element that is not read", (1, 5)),
            ("GeoLocation", (1, 5)),
            ("Inline", (1, 5)),
            ("ProtoDeclare", (1, 5)),
        ]
    );
    assert_eq!(found.places.len(), 1);
}

#[test]
fn a_transform_that_cannot_be_read_hides_its_children() {
    let found = pieces(&format!("<Transform DEF='t' scale='1 2'>{CUBE}</Transform>{CUBE}<Group USE='t'/>"));
    assert_eq!(found.places.len(), 1);
    let warnings = found.report.warnings();
    assert_eq!(
        warnings,
        ["line 3: Transform \"t\" and all in it: scale has 2 numbers, not a multiple of 3; left out"]
    );
}

#[test]
fn byte_order_marks_prefixes_and_comments() {
    let text = file(&format!("<!-- <Shape> -->{CUBE}<![CDATA[<Shape>]]>"));
    assert_eq!(opened(&format!("\u{feff}{text}")).unwrap().facets(), 12);
    let prefixed = "<x:X3D xmlns:x='u'><x:Scene><x:Shape><x:Extrusion/></x:Shape></x:Scene></x:X3D>";
    assert_eq!(opened(prefixed).unwrap().facets(), 12);
}
