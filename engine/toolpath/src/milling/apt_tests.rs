//! CL files of APT with moves that are known.

use super::Program;
use super::tests::{is_refused, read_named, told};

fn apt(text: &str) -> Program {
    read_named("p.cls", text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

fn ends(text: &str) -> Vec<String> {
    apt(text).moves.iter().map(told).collect()
}

#[test]
fn straight_moves_follow_words_units_and_lines() {
    assert_eq!(
        ends(
            "PARTNO/LID\n$$ -> comment\nMULTAX/ON\nUNITS / MM\nFROM/0,0,10\nRAPID\ngoto/1,2,3\nFEDRAT/250,MMPM\nGOTO / 4.5, -2E1, $ more\n 3 $$ here\nGODLTA/-1\nGODLTA/1,1,1\nUNITS/INCHES\nGOTO/1,0,0\nGOHOME\nGOTO/5,5,5\nGOTO/5,5,6\nFINI\nGOTO/9,9,9\n"
        ),
        [
            "R[1.0, 2.0, 3.0]",
            "[4.5, -20.0, 3.0]",
            "[4.5, -20.0, 2.0]",
            "[5.5, -19.0, 3.0]",
            "[25.4, 0.0, 0.0]",
            "[127.0, 127.0, 152.4]"
        ]
    );
    let program = apt("FROM/0,0,0\nWHATEVER/1,2\nGOTO/1,0,0\nWHATEVER\nINSERT/G4 X1\nSPINDL/RPM,100,CLW\n");
    let skipped: Vec<String> = program.skipped.iter().map(|(word, n)| format!("{word} {n}")).collect();
    assert_eq!(skipped, ["INSERT 1", "WHATEVER 2"]);
    // By its words, whatever its name.
    assert_eq!(read_named("p.txt", b"$$ x\nFROM/0,0,0\nGOTO/1,0,0\n").unwrap().moves.len(), 1);
}

#[test]
fn blocks_have_numbers_labels_and_texts() {
    assert_eq!(
        ends(
            "PARTNO A-12: lid (rev. B), 1/2\nN10 FROM/0,0,0\n20 GOTO/1,0,0\nL1) GOTO/2,0,0\nPPRINT {any} text: 1,2\nREMARK x, y\nN40\tRAPID\nn50 GOTO / 3,0,0\n"
        ),
        ["[1.0, 0.0, 0.0]", "[2.0, 0.0, 0.0]", "R[3.0, 0.0, 0.0]"]
    );
    assert_eq!(apt("N1 PARTNO\nFROM/0,0,0\nGOTO/1,0,0\nN3 INSERT ({})\n").skipped.len(), 1);
}

#[test]
fn arcs_turn_about_their_direction_and_rise() {
    for (normal, way) in [(1.0, 1.0), (-1.0, -1.0)] {
        let program =
            apt(&format!("FROM/10,0,0\nCIRCLE/0,0,0,0,0,{normal},10,0.01,0.5,10,0\nGOTO/-10,0,2\n"));
        let middle = program.moves[program.moves.len() / 2 - 1].to;
        assert!(program.moves.iter().all(|m| (m.to[0].hypot(m.to[1]) - 10.0).abs() < 1e-9));
        assert!((middle[1] - 10.0 * way).abs() < 1e-9 && (middle[2] - 1.0).abs() < 1e-9, "{middle:?}");
        assert_eq!((program.arcs, program.moves.last().unwrap().to), (1, [-10.0, 0.0, 2.0]));
    }
    let circle = apt("FROM/10,0,0\nCIRCLE/0,0,0,0,1,0,10\nGOTO/10,0,0\n");
    let length: f64 = circle.moves.iter().map(|m| (m.to[0] - m.from[0]).hypot(m.to[2] - m.from[2])).sum();
    assert!((length - 20.0 * std::f64::consts::PI).abs() < 0.05 && length > 60.0, "{length}");
}

#[test]
fn the_tool_turns_along_the_shortest_way_in_steps() {
    let program = apt("FROM/0,0,0,0,0,1\nGOTO/8,0,0,0.6,0,0.8\nGOTO/9,0,0\n");
    let steps = &program.moves[..program.moves.len() - 1];
    assert_eq!(program.turning_steps, steps.len() as u64);
    assert_eq!(program.moves.last().unwrap().axis, [0.6, 0.0, 0.8]);
    let angle = 0.6f64.asin();
    for m in steps {
        let middle = (m.from[0] + m.to[0]) / 16.0 * angle;
        assert!((m.axis[0] - middle.sin()).abs() < 1e-9 && m.axis[1] == 0.0, "{m:?}");
        assert!(m.turn <= 0.02 && m.turn > 0.005, "{m:?}");
    }
}

#[test]
fn cycles_drill_along_the_axis_at_each_place() {
    assert_eq!(
        ends(
            "FROM/0,0,50\nCYCLE/DRILL,RAPTO,3.0,FEDTO,-10.0,RTRCTO,5,MMPM,250\nGOTO/1,0,0\nGOTO/2,0,0\nCYCLE/OFF\nGOTO/2,0,9\n"
        ),
        [
            "R[1.0, 0.0, 3.0]",
            "[1.0, 0.0, -10.0]",
            "R[1.0, 0.0, 5.0]",
            "R[2.0, 0.0, 3.0]",
            "[2.0, 0.0, -10.0]",
            "R[2.0, 0.0, 5.0]",
            "[2.0, 0.0, 9.0]"
        ]
    );
}

#[test]
fn tools_come_from_cutter_and_tldata() {
    let tools = |text: &str| {
        let program = apt(text);
        program.tools.iter().map(|(n, tool)| format!("T{n} {tool}")).collect::<Vec<_>>()
    };
    assert_eq!(
        tools(
            "TLDATA/MILL,10.0,2.0,75.0,0.0,0.0\nLOAD/TOOL,3\nFROM/0,0,0\nGOTO/1,0,0\nUNITS/INCHES\nCUTTER/0.25,0.125\nLOADTL/4,1\nGOTO/2,0,0\nTLDATA/DRILL,MILL,8,0,50\nLOADTL/5\nGOTO/3,0,0\n"
        ),
        ["T3 bull:10mm,2mm", "T4 ball:6.35mm", "T5 flat:6mm"]
    );
    // The unit counts for what stands in front of it.
    let inches = "PARTNO A\nCUTTER/0.5\nLOADTL/1\n10 UNITS / INCHES $$ of all\nFROM/0,0,0\nGOTO/1,0,0\n";
    assert_eq!(tools(inches), ["T1 flat:12.7mm"]);
    assert_eq!(
        tools("CUTTER/12.0,0,6,0,0,0,30\nFROM/0,0,0\nGOTO/1,0,0\nCUTTER/12\nGOTO/2,0,0\n"),
        ["T0 flat:12mm"]
    );
}

#[test]
fn what_cannot_be_followed_names_line_and_word() {
    for (text, words) in [
        ("FROM/0,0,0\nGOTO/1,2\n", ["line 2", "\"GOTO\" has 2 numbers"]),
        ("FROM/0,0,0\n\nGOTO/1,b,3\n", ["line 3", "\"b\" where a number"]),
        ("FROM/0,0,0\nGOTO/1,2,nan\n", ["line 2", "\"nan\""]),
        ("FROM/0,0,0\nGOTO/1,2,3,0,0,2\n", ["line 2", "length is not 1"]),
        ("FROM/0,0,0\nGOTO/1,2,$\n", ["line 2", "goes on"]),
        ("GODLTA/1,2,3\n", ["line 1", "does not tell"]),
        ("FROM/0,0,0\nTLON,GOFWD/(CIRCLE/0,0,0,1),ON,2\n", ["line 2", "\"TLON\" moves"]),
        ("FROM/0,0,0\nCUTCOM/LEFT\n", ["line 2", "radius of the tool"]),
        ("FROM/0,0,0\nCIRCLE/0,0,0,0,0,1,5\nGOTO/1,0,0\n", ["line 3", "centre is one of its ends"]),
        ("FROM/3,0,0\nCIRCLE/0,0,0,0,0,1,5\nGOTO/0,3,0\n", ["line 3", "not where the arc's ends are"]),
        ("FROM/0,0,0,0,0,1\nGOTO/1,0,0,0,0,-1\n", ["line 2", "upside down"]),
        ("MSYS/1,0,0,1,0,0,0,1,0\nFROM/0,0,0\n", ["line 1", "moves the coordinates"]),
        ("UNITS/FEET\n", ["line 1", "no unit"]),
        ("CYCLE/DRILL,MMPM,3\n", ["line 1", "has no DEPTH"]),
        ("FROM/0,0,0\n{GOTO/1,1,1}\n", ["line 2", "no word of APT"]),
        ("CUTTER/6\nFROM/0,0,0\nGOTO/1,0,0\nCUTTER/8\nGOTO/2,0,0\n", ["line 5", "another form"]),
        ("FROM/0,0,0\nP1 = GOTO/1,1,1\n", ["line 2", "before the motion"]),
        ("FROM/0,0,0\nIF X GOTO/1,1,1\n", ["line 2", "before the motion"]),
        ("PARTNO/EMPTY\nFINI\n", ["end", "has no moves"]),
    ] {
        is_refused("p.apt", text, &words);
    }
}
