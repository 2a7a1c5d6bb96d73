//! Laws of offsets, planes, units and layer axes.

use super::*;
use proptest::prelude::*;
use std::fmt::Write;

fn options() -> GcodeOptions {
    GcodeOptions { width: Some(2.0), height: Some(1.0), ..GcodeOptions::default() }
}

/// The points of all beads.
fn points(text: &str, options: &GcodeOptions) -> Vec<Vec<[f64; 3]>> {
    let path = parse(text, options).unwrap_or_else(|error| panic!("{text}: {error}")).1;
    (0..path.len()).map(|bead| path.points(bead).to_vec()).collect()
}

fn same(a: &[Vec<[f64; 3]>], b: &[Vec<[f64; 3]>]) -> bool {
    a.iter().map(Vec::len).eq(b.iter().map(Vec::len))
        && a.iter().flatten().flatten().zip(b.iter().flatten().flatten()).all(|(a, b)| (a - b).abs() < 1e-7)
}

/// A move: whether it deposits, and where it goes, in thousandths of mm.
type Move = (bool, [i32; 3]);

fn moves() -> impl Strategy<Value = Vec<Move>> {
    let place = prop::array::uniform3(-99_999i32..100_000);
    prop::collection::vec((any::<bool>(), place), 1..20).prop_map(|mut moves| {
        moves[0].0 = true;
        moves
    })
}

/// The program, with `offset` (thousandths of mm) taken off its coordinates, which are thousandths of `unit` mm.
fn program(moves: &[Move], offset: [i32; 3], unit: f64, axes: [&str; 3]) -> String {
    let mut text = String::new();
    for (deposits, place) in moves {
        text += if *deposits { "M3 S5\nG1" } else { "M5\nG0" };
        for axis in 0..3 {
            let value = f64::from(place[axis] - offset[axis]) / 1000.0 / unit;
            write!(text, " {}{value:.12}", axes[axis]).unwrap();
        }
        text.push('\n');
    }
    text
}

const XYZ: [&str; 3] = ["X", "Y", "Z"];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn offsets_and_their_inverses_give_the_same_beads(
        moves in moves(), offset in prop::array::uniform3(-99_999i32..100_000), system in 1usize..10,
    ) {
        let expected = points(&program(&moves, [0; 3], 1.0, XYZ), &options());
        let [x, y, z] = offset.map(|value| f64::from(value) / 1000.0);
        let codes = ["G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"];
        let code = codes[system - 1];
        let shifted = program(&moves, offset, 1.0, XYZ);
        for head in [
            format!("G10 L2 P{system} X{x} Y{y} Z{z}\n{code}\n"),
            format!("{code}\nG10 L2 P0 X{x} Y{y} Z{z}\n"),
            format!("{code}\nG10 L20 P{system} X{} Y{} Z{}\n", -x, -y, -z),
            format!("G52 X{x} Y{y} Z{z}\n"),
            format!("G92 X{} Y{} Z{}\n", -x, -y, -z),
            format!("SET_GCODE_OFFSET X={x} Y={y} Z={z}\n"),
            format!("G10 L2 P{system} X{} Y{y}\nG52 X{}\n{code}\nSET_GCODE_OFFSET Z={z}\n", x - 7.0, 7.0),
        ] {
            let found = points(&(head.clone() + &shifted), &options());
            prop_assert!(same(&found, &expected), "{}: {:?} instead of {:?}", head, found, expected);
        }
        // Put away again, they leave no trace.
        let back = format!(
            "SAVE_GCODE_STATE NAME=a\nSET_GCODE_OFFSET X={x}\nRESTORE_GCODE_STATE NAME=a\nG92 Y{y}\nG92.1\n\
             G52 Z{z}\nG52 Z0\nG10 L2 P{system} X{x}\n{code}\nG10 L2 P{system} X0\n"
        );
        let found = points(&(back + &program(&moves, [0; 3], 1.0, XYZ)), &options());
        prop_assert!(same(&found, &expected));
    }

    #[test]
    fn a_program_in_inches_gives_the_same_beads(moves in moves()) {
        let expected = points(&program(&moves, [0; 3], 1.0, XYZ), &options());
        let inches = program(&moves, [0; 3], 25.4, XYZ);
        let by_option = points(&inches, &GcodeOptions { unit: Some(25.4), ..options() });
        let by_code = points(&format!("G20\n{inches}"), &options());
        let by_header = points(&format!("; G-Code Syntax: Cincinnati\n{inches}"), &options());
        prop_assert!(same(&by_option, &expected) && by_option == by_code && by_option == by_header);
    }

    #[test]
    fn a_table_gives_the_same_beads_as_z(moves in moves()) {
        let expected = points(&program(&moves, [0; 3], 1.0, XYZ), &options());
        // The table goes down as far as the tool would have gone up.
        let tables: Vec<Move> = moves.iter().map(|(on, [x, y, z])| (*on, [*x, *y, -z])).collect();
        for (axes, axis) in [(["X", "Y", "W"], "-W"), (["X", "Y", "U"], "-U"), (["X", "Y", "Z"], "-Z")] {
            let options = GcodeOptions { layer_axis: Some(axis.parse().unwrap()), ..options() };
            let found = points(&program(&tables, [0; 3], 1.0, axes), &options);
            prop_assert!(same(&found, &expected), "{}: {:?} instead of {:?}", axis, found, expected);
        }
        let options = GcodeOptions { layer_axis: Some("V".parse().unwrap()), ..options() };
        prop_assert!(same(&points(&program(&moves, [0; 3], 1.0, ["X", "Y", "V"]), &options), &expected));
    }

    #[test]
    fn arcs_of_other_planes_are_those_of_g17_with_axes_permuted(
        radius in 0.5f64..50.0, from in 0.0f64..360.0, sweep in 5.0f64..355.0, rise in -5.0f64..5.0, clockwise: bool,
    ) {
        let at = |degrees: f64| [radius * degrees.to_radians().cos(), radius * degrees.to_radians().sin()];
        let (start, end) = (at(from), at(if clockwise { from - sweep } else { from + sweep }));
        let code = if clockwise { "G2" } else { "G3" };
        let long = if sweep > 180.0 { -radius } else { radius };
        let arc = |plane: &str, [u, v, w]: [&str; 3], [i, j]: [&str; 2], by_radius: bool| {
            let centre = match by_radius {
                true => format!("R{long:.12}"),
                false => format!("{i}{:.12} {j}{:.12}", -start[0], -start[1]),
            };
            let ([su, sv], [eu, ev]) = (start, end);
            let text = format!(
                "{plane}\nG0 {u}{su:.12} {v}{sv:.12} {w}0\nM3\n{code} {u}{eu:.12} {v}{ev:.12} {w}{rise:.12} {centre}\n"
            );
            let path = parse(text, &options()).unwrap().1;
            path.points(0).to_vec()
        };
        let near = |a: &[[f64; 3]], b: &[[f64; 3]], tolerance: f64| {
            a.len() == b.len()
                && a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() < tolerance)
        };
        let flat = arc("G17", ["X", "Y", "Z"], ["I", "J"], false);
        for by_radius in [false, true] {
            let plain = arc("G17", ["X", "Y", "Z"], ["I", "J"], by_radius);
            // Near a half turn a radius tells the centre badly.
            let tolerance = if (sweep - 180.0).abs() < 5.0 { f64::INFINITY } else { 1e-4 };
            prop_assert!(near(&flat, &plain, tolerance) || (sweep - 180.0).abs() < 5.0);
            let zx = arc("G18", ["Z", "X", "Y"], ["K", "I"], by_radius);
            let yz = arc("G19", ["Y", "Z", "X"], ["J", "K"], by_radius);
            let turned: Vec<[f64; 3]> = plain.iter().map(|[u, v, w]| [*v, *w, *u]).collect();
            prop_assert!(near(&zx, &turned, 1e-9), "{:?} instead of {:?}", zx, turned);
            let turned: Vec<[f64; 3]> = plain.iter().map(|[u, v, w]| [*w, *u, *v]).collect();
            prop_assert!(near(&yz, &turned, 1e-9), "{:?} instead of {:?}", yz, turned);
        }
    }

    #[test]
    fn any_words_of_large_machines_end_in_beads_or_an_error(
        bytes in prop::collection::vec(prop::sample::select(&b"GGMXYZWSEAR#=[]()<>0123456789.-+ \n\n\n;BLTPH_{"[..]), 0..400),
        heads in prop::collection::vec(prop::sample::select(vec![
            "EXTRUDER(", "BEAD_AREA=", "(LAYER ", "G10 L2 P", "RESTORE_GCODE_STATE", "#1=", "A3=", "M3 S", "G53 X", "G0 W",
        ]), 0..9),
    ) {
        let mut text = Vec::new();
        for (line, head) in bytes.split(|b| *b == b'\n').zip(heads.iter().map(Some).chain(std::iter::repeat(None))) {
            text.extend_from_slice(head.map_or(b"", |head| head.as_bytes()));
            text.extend_from_slice(line);
            text.push(b'\n');
        }
        for options in [GcodeOptions::default(), options()] {
            if let Err(error) = parse(&text, &options) {
                prop_assert!(!error.to_string().contains('\n'));
            }
        }
    }
}
