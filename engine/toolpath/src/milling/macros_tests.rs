//! Variables, jumps, loops and calls that pass values, against places that are computed by hand.

use super::formula::FormulaReader;
use super::tests::{ends, is_refused};
use super::variables::{MacroVariables, VariableName};

fn evaluated(text: &str) -> Result<Option<f64>, String> {
    let mut variables = MacroVariables::new();
    for (number, value) in [(1, 2.0), (2, 0.5), (101, -3.0), (102, 1.0)] {
        variables.set(VariableName::Number(number), Some(value)).unwrap();
    }
    let clean = super::statement::cleaned(text.as_bytes());
    let mut reader = FormulaReader::new(&clean, &variables);
    let value = reader.expression()?;
    if reader.rest().is_empty() { Ok(value) } else { Err(format!("stops at {:?}", reader.rest())) }
}

#[test]
fn expressions_have_the_value_of_arithmetic() {
    for (text, expected) in [
        ("1.5", 1.5),
        ("#1 + 2 * 3", 8.0),
        ("[#1 + 2] * 3", 12.0),
        ("-#101 - -.5", 3.5),
        ("8/2/#1", 2.0),
        ("##1", 0.5),
        ("#[100 + #1]", 1.0),
        ("#33 + 1", 1.0),
        ("7 MOD 4", 3.0),
        ("2 ** 3 * 2", 16.0),
        ("SIN[30] + COS[60]", 1.0),
        ("SIN[180]", 0.0),
        ("TAN[45]", 1.0),
        ("ATAN[1]/[1]", 45.0),
        ("ATAN[0]/[-1]", 180.0),
        ("ACOS[0]", 90.0),
        ("ASIN[1]", 90.0),
        ("SQRT[[#1 + 1] * 3]", 3.0),
        ("ABS[#101]", 3.0),
        ("ROUND[2.5] + ROUND[-2.5] + ROUND[2.4]", 2.0),
        ("FIX[2.7] + FUP[2.2]", 5.0),
        ("EXP[0] + LN[1]", 1.0),
        ("#1 GT 1", 1.0),
        ("[#1 EQ 2] AND [#33 EQ #0] AND [#2 NE #0]", 1.0),
        ("[#1 LT 2] OR [#1 LE 1.9]", 0.0),
        ("[#1 GE 2] XOR [#1 NE 2]", 1.0),
        ("0.1 + 0.2 LE 0.4", 1.0),
    ] {
        let found = evaluated(text).unwrap_or_else(|what| panic!("{text}: {what}"));
        assert!((found.unwrap() - expected).abs() < 1e-15, "{text}: {found:?}");
    }
    assert_eq!(evaluated("#3"), Ok(None));
    for (text, words) in [
        ("1/0", "divides by zero"),
        ("1 MOD 0", "divides by zero"),
        ("-1 MOD 2", "different ways"),
        ("[0.3] MOD 0.1", "rounding before decides"),
        ("SQRT[-1]", "root of -1"),
        ("LN[0]", "LN of 0"),
        ("ASIN[2]", "ASIN of 2"),
        ("TAN[90]", "TAN of 90"),
        ("ATAN[0]/[0]", "no direction"),
        ("ATAN[-1]/[1]", "-45"),
        ("FIX[-1.5]", "different ways"),
        ("FIX[[0.1 + 0.2] * 10]", "rounding before decides"),
        ("0.1 + 0.2 EQ 0.3", "rounding alone"),
        ("0.1 + 0.2 GT 0.3", "rounding alone"),
        ("#1 AND #2", "joins numbers"),
        ("[1 EQ 1] AND [1 EQ 1] OR [1 EQ 1]", "mixes OR"),
        ("BIN[3]", "function BIN"),
        ("EXP[1000]", "no value that is finite"),
        ("#500", "#500, which the program has not set"),
        ("#<width>", "#<WIDTH>, which the program has not set"),
        ("#1000", "of the machine"),
        ("#5021", "of the machine"),
        ("#[0.5]", "no whole number"),
        ("[1", "closing bracket"),
        ("#", "needs a variable"),
        ("", "not understood"),
    ] {
        let what = evaluated(text).unwrap_err();
        assert!(what.contains(words), "{text}: {what}");
    }
    assert!(evaluated(&"[".repeat(10_000)).unwrap_err().contains("more brackets"));
}

#[test]
fn words_take_variables_and_expressions() {
    assert_eq!(
        ends(
            "#1=2.5 (depth)\nN20 #<far away> = [#1 * 4]\n#100=#1\nG0 X0 Y0 Z#1\nG1 X#<FarAway>Y-#1 Z[-#100 + 1] F[#1*100]\nX#2 Y1\nG[2-1] X#<far away>\n"
        ),
        ["[10.0, -2.5, -1.5]", "[10.0, 1.0, -1.5]", "[10.0, 1.0, -1.5]"]
    );
    // To the last bit.
    let program = super::tests::read_text("#1=0.1+0.2\nG0 X0 Y0 Z0\nX#1\n").unwrap();
    assert_eq!(program.moves[0].to[0].to_bits(), (0.1f64 + 0.2).to_bits());
}

#[test]
fn loops_and_jumps_are_carried_out() {
    let circle = "G0 X0 Y0 Z5\n#1=0\nWHILE [#1 LT 4] DO1\n#2=10*COS[#1*90]\n#3=10*SIN[#1*90]\nG0 X#2 Y#3\n#1=#1+1\nEND1\nZ9\n";
    let expected = [
        "R[10.0, 0.0, 5.0]",
        "R[0.0, 10.0, 5.0]",
        "R[-10.0, 0.0, 5.0]",
        "R[0.0, -10.0, 5.0]",
        "R[0.0, -10.0, 9.0]",
    ];
    assert_eq!(ends(circle), expected);
    let jumps = "G0 X0 Y0 Z5\n#1=0\nN10 #2=10*COS[#1*90]\n#3=10*SIN[#1*90]\nG0 X#2 Y#3\n#1=#1+1\nIF [#1 LT 4] GOTO 10\nGOTO99\nX77\nN99Z9\n";
    assert_eq!(ends(jumps), expected);
    // Out of a loop without a condition, by a number that is computed.
    let out = circle.replace("WHILE [#1 LT 4] DO1", "DO 1\nIF[#1GE4]GOTO[40+2]").replace("Z9", "N42 Z9");
    assert_eq!(ends(&out), expected);
    let nested = "G0 X0 Y0 Z0\n#2=1\nWHILE[#2LE2]DO1\n#3=1\nWHILE[#3LE2]DO2\nG1 X#2 Y#3\n#3=#3+1\nEND2\n#2=#2+1\nEND1\n";
    assert_eq!(ends(nested), ["[1.0, 1.0, 0.0]", "[1.0, 2.0, 0.0]", "[2.0, 1.0, 0.0]", "[2.0, 2.0, 0.0]"]);
    // A loop that is not entered, and conditions that set.
    assert_eq!(
        ends(
            "#1=3\nG0 X0 Y0 Z0\nWHILE[#1GT5]DO1\nG1 X99\nEND1\nIF[#1EQ3]THEN#2=7\nIF[#1EQ4]THEN#2=1/0\nG1 X#2\n"
        ),
        ["[7.0, 0.0, 0.0]"]
    );
}

#[test]
fn loops_and_conditions_of_linuxcnc_are_carried_out() {
    let moves = |text: &str| ends(&format!("G0 X0 Y0 Z0\n{text}"));
    let expected = ["[1.0, 0.0, 0.0]", "[2.0, 0.0, 0.0]", "[3.0, 0.0, 0.0]"];
    let counted = "#1=1\no100 while [#1 LE 3]\nG1 X#1\n#1=[#1+1]\no100 endwhile\n";
    assert_eq!(moves(counted), expected);
    assert_eq!(moves("#1=0\no<n> do\n#1=[#1+1]\nG1 X#1\no<N> while [#1 LT 3]\n"), expected);
    let left = "#1=0\no1 while [1 EQ 1]\n#1=[#1+1]\no2 if [#1 GT 3]\no1 break\no2 endif\no3 if [#1 LT 0]\nX99\no3 else\nG1 X#1\no3 endif\no1 continue\nX77\no1 endwhile\n";
    assert_eq!(moves(left), expected);
    let branch = |n: u32| {
        moves(&format!(
            "#1={n}\no1 if [#1 EQ 1] (one)\nG1 X1\no1 elseif [#1 EQ 2]\nG1 X2\no1 elseif [#1 EQ 9]\nX9\no1 else\nG1 X3\no1 endif\nY1\n"
        ))
    };
    for n in 1..=3 {
        assert_eq!(branch(n), [format!("[{n}.0, 0.0, 0.0]"), format!("[{n}.0, 1.0, 0.0]")]);
    }
}

#[test]
fn calls_pass_values_of_their_own() {
    let holes = "G0 X0 Y0 Z5\n#1=9\n#100=4.\nG65 P9010 X5. Y[#100+1] Z-2. H2 (two holes)\nX#1\nM30\nO9010\n#3=0\nWHILE[#3LT#11]DO1\nG0 X[#24+#3*#100] Y#25\nG1 Z#26 F100\nG0 Z5\n#3=#3+1\n#1=77\nEND1\nM99\n";
    assert_eq!(
        ends(holes),
        [
            "R[5.0, 5.0, 5.0]",
            "[5.0, 5.0, -2.0]",
            "R[5.0, 5.0, 5.0]",
            "R[9.0, 5.0, 5.0]",
            "[9.0, 5.0, -2.0]",
            "R[9.0, 5.0, 5.0]",
            "R[9.0, 5.0, 5.0]"
        ]
    );
    // M98 shares variables; jumps stay within the subprogram.
    assert_eq!(
        ends("G0 X0 Y0 Z0\n#1=3\nM98 P[2*50]\nN10 G1 X#1\nM30\nO100\nGOTO10\nX88\nN10 #1=#1+1\nM99\n"),
        ["[4.0, 0.0, 0.0]"]
    );
    assert_eq!(
        ends(
            "o<peck> sub\nG1 X#1 Y#2\nZ#3\no<peck> endsub\nG0 X0 Y0 Z9\n#1=1.\no<peck> call [#1+2] [5]\nG0 X#1\nM2\n"
        ),
        ["[3.0, 5.0, 9.0]", "[3.0, 5.0, 0.0]", "R[1.0, 5.0, 0.0]"]
    );
}

#[test]
fn macros_that_cannot_be_followed_are_told() {
    for (text, words) in [
        ("GOTO 5", ["line 2", "N5, which this program has not"]),
        ("GOTO 5\nN5\nN5", ["line 2", "N5, which this program has twice"]),
        ("GOTO 5\nM30\nO9\nN5 M99", ["line 2", "N5, which this program has not"]),
        ("GOTO #1", ["line 2", "number of a block"]),
        ("GOTO 5\nDO1\nN5 X1\nEND1", ["line 2", "into a loop"]),
        ("WHILE[1EQ1]DO1\nX1", ["line 2", "without END1"]),
        ("END1", ["line 2", "no DO1"]),
        ("DO1\nDO1\nEND1\nEND1", ["line 3", "END1 of its own"]),
        ("WHILE[1EQ1]", ["line 2", "without DO"]),
        ("WHILE[1]DO1\nEND1", ["line 2", "compares nothing"]),
        ("IF[1EQ1]X5", ["line 2", "without GOTO or THEN"]),
        ("DO1\nEND1", ["\"DO1\"", "repeats more lines"]),
        ("N1 GOTO 1", ["line 2", "repeats more lines"]),
        ("#1=1 #2=2", ["line 2", "each variable a line"]),
        ("#1=1/0", ["line 2", "\"#1=1/0\" divides by zero"]),
        ("#1", ["line 2", "needs ="]),
        ("#5021=1", ["line 2", "of the machine"]),
        ("#0=1", ["line 2", "always empty"]),
        ("X#1+2", ["line 2", "not understood as words"]),
        ("X-#1", ["line 2", "empty variable a sign"]),
        ("X#1=5", ["line 2", "not understood as words"]),
        ("X[1e9*10]", ["line 2", "closing bracket"]),
        ("X[1000000*10000]", ["line 2", "out of range"]),
        ("X#500", ["line 2", "has not set"]),
        ("X[ROUND[1.5]]", ["line 2", "rounds within a word"]),
        ("G65 P1", ["line 2", "O1, which the file has not"]),
        ("G65 A1.", ["line 2", "needs P"]),
        ("G65 P1 A1\nM30\nO1\nM99", ["line 2", "\"A1\" passes a number without a decimal point"]),
        ("G65 P1 L2 A1.\nM30\nO1\nM99", ["line 2", "\"L2\" repeats"]),
        ("G65 P1 I1. I2.\nM30\nO1\nM99", ["line 2", "out of order"]),
        ("G65 P1 J1. I2.\nM30\nO1\nM99", ["line 2", "out of order"]),
        ("G65 P1 G1\nM30\nO1\nM99", ["line 2", "\"G1\" is no word"]),
        ("G1 G65 P1\nM30\nO1\nM99", ["line 2", "beside other words"]),
        ("G66 P1 A1.", ["line 2", "at each move"]),
        ("G65 P1\nM30\nO1\nG65 P1\nM99", ["line 5", "within itself"]),
        ("o1 sub\no1 endsub\no1 call [1/0]", ["line 4", "divides by zero"]),
        ("o1 sub\no1 endsub\no1 call 5", ["line 4", "no value in brackets"]),
        ("o1 repeat [5]\no1 endrepeat", ["line 2", "a loop or a condition"]),
        ("o1 while [1 EQ 2]", ["line 2", "no other line"]),
        ("o1 while [1 EQ 1]\no2 endwhile", ["line 3", "no other line"]),
        ("o1 while [1 EQ 1]\no1 endwhile", ["o1 ", "repeats more lines"]),
        ("o1 do\nX1", ["line 2", "no other line"]),
        ("o1 if [1 EQ 2]\nX1", ["line 2", "no other line"]),
        ("o1 if [1 EQ 2] 5\no1 endif", ["line 2", "behind its condition"]),
        ("o1 if [1 EQ 2]\no1 elseif [1/0 EQ 1]\no1 endif", ["line 3", "divides by zero"]),
        ("o1 else\no1 endif", ["line 2", "no other line"]),
        ("o1 break", ["line 2", "no other line"]),
    ] {
        is_refused("p.nc", &format!("G0 X0 Y0 Z0\n{text}\n"), &words);
    }
    let many = "o1 if [1 EQ 1]\no1 endif\n".repeat(600);
    is_refused("p.nc", &many, &["line 1", "more lines than can be followed"]);
}
