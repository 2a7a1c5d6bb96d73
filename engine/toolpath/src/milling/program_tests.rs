//! Subprograms, and programs that are damaged.

use super::tests::{ends, is_refused, read_named, read_text};

/// A square of 2 mm, relative, as a subprogram's lines.
const STEP: &str = "G91 G1 X2\nY2\nG90\n";

#[test]
fn subprograms_are_carried_out_as_if_they_stood_in_the_program() {
    let expected = ends(&format!("G0 X0 Y0 Z0\n{STEP}{STEP}G0 X50\n{STEP}M30\n"));
    let fanuc =
        format!("%\nO1000 (MAIN)\nG0 X0 Y0 Z0\nM98 P2000 L2\nG0 X50\nM98 P2000\nM30\nO2000\n{STEP}M99\n%\n");
    assert_eq!(ends(&fanuc), expected);
    // Repeats in front of the number, zeros, and a main program that ends by M99.
    let digits = fanuc.replace("M98 P2000 L2", "M98P22000").replace("O2000", "o02000").replace("M30", "M99");
    assert_eq!(ends(&digits), expected);
    let linux = format!(
        "o<step> sub\n{STEP}o<step> endsub\no7 sub\no<step> call\no<STEP> call ; again\no7 return\nG1 X99\no7 endsub\nG0 X0 Y0 Z0\no7 call\nG0 X50\no<step> call (last)\nM2\n"
    );
    assert_eq!(ends(&linux), expected);
    // By the number of a block; one that nothing calls is no end.
    let local = format!(
        "G0 X0 Y0 Z0\nM97 P20 L2\nN10 G0 X50\n/M97 P20\nM30\nN5 G1 X99\nN20\n{STEP}M97 P30\nM99\nN30 M99\n"
    );
    assert_eq!(ends(&local), expected);
    // Within each other, and not at all.
    let nested = format!(
        "G0 X0 Y0 Z0\nM98 P1\nG0 X50\nM98 P2 L1\nM98 P2 L0\nM30\nO1\nM98 P2 L2\nM99\nO2\n{STEP}M99\n"
    );
    assert_eq!(ends(&nested), expected);
}

#[test]
fn calls_that_cannot_be_followed_are_told() {
    for (text, words) in [
        ("G0 X0 Y0 Z0\nM98 P5\nM30\n", ["line 2", "calls O5, which the file has not"]),
        ("G0 X0 Y0 Z0\nM98 (other.nc)\n", ["line 2", "in another file"]),
        ("O1\nG0 X0 Y0 Z0\nM98 P1\nM30\n", ["line 3", "within itself"]),
        ("G0 X0 Y0 Z0\nM98 P1\nM30\nO1\nM98 P2\nM99\nO2\nM98 P1\nM99\n", ["line 8", "O1 within itself"]),
        ("G0 X0 Y0 Z0\nM98 P1\nM30\nO1\nG1 X1\n", ["O1", "without an end"]),
        ("G0 X0 Y0 Z0\nM98 P1\nM30\nO1\nG1 X1\nO2\nM99\n", ["line 6", "before M99 has ended"]),
        (
            "O1\nG1 X1\nM99\nO2\nG0 X0 Y0 Z0\nM98 P1\nM30\n",
            ["line 2", "place that the program does not tell"],
        ),
        ("O1\nG0 X1\nM99\nO2\nG0 X0 Y0 Z0\nM98 P1\nM30\n", ["line 3", "O2 follows"]),
        ("G0 X0 Y0 Z0\nM98 P1\nO1\nG1 X1\nM99\n", ["line 3", "has no end"]),
        ("G0 X0 Y0 Z0\nM98 P1\nM30\nO1\nM99\nO1\nM99\n", ["line 2", "has twice"]),
        ("G0 X0 Y0 Z0\nM97 P10\n", ["line 2", "calls N10, which the file has not"]),
        ("G0 X0 Y0 Z0\nM97 P10\nM30\nN10 M99\nN10 M99\n", ["line 2", "calls N10, which the file has twice"]),
        ("G0 X0 Y0 Z0\nM97 P10\nM30\nN10 G1 X1\nM97 P10\nM99\n", ["line 5", "N10 within itself"]),
        ("G0 X0 Y0 Z0\nM97 P10\nM30\nN10 G1 X1\n", ["\"N10\"", "without an end"]),
        ("G0 X0 Y0 Z0\nM97\n", ["line 2", "a whole number"]),
        ("G0 X0 Y0 Z0\nM96 P10\n", ["line 2", "is not read"]),
        ("G0 X0 Y0 Z0\nM98 P1\nM30\nO1\nM99 P30\n", ["line 5", "by its number"]),
        ("G0 X0 Y0 Z0\nG65 P1 A3.\n", ["line 2", "calls O1, which the file has not"]),
        ("G0 X0 Y0 Z0\no1 repeat [5]\no1 endrepeat\n", ["line 2", "a loop or a condition"]),
        ("o1 sub\nG0 X0 Y0 Z0\n", ["line 1", "has no endsub"]),
        ("o1 endsub\nG0 X0 Y0 Z0\n", ["line 1", "has not begun"]),
    ] {
        is_refused("p.nc", text, &words);
    }
    // Calls within calls multiply: more than can be followed is told and not carried out to the end.
    let mut text = "G0 X0 Y0 Z0\nM98 P1 L9999\nM30\n".to_owned();
    for n in 1..=8 {
        text += &format!("O{n}\nM98 P{} L9999\nM99\n", n + 1);
    }
    text += "O9\nM99\n";
    let error = read_text(&text).unwrap_err().to_string();
    assert!(error.contains("repeats more lines"), "{error}");
    let mut deep = "G0 X0 Y0 Z0\nM98 P1\nM30\n".to_owned();
    (1..=60).for_each(|n| deep += &format!("O{n}\nM98 P{}\nM99\n", n + 1));
    let error = read_text(&(deep + "O61\nM99\n")).unwrap_err().to_string();
    assert!(error.contains("within each other"), "{error}");
}

#[test]
fn damaged_programs_are_read_or_told_in_one_line() {
    let programs = [
        (
            "p.nc",
            "%\nO1 (M)\nG21 G90\nT1 M6\nG0 X0 Y0 Z5\nM98 P2 L3\nG41.1 D2 X1\nY3\nX-4\nG3 X-6 Y5 I0 J2\nG40 X0\nG2 X5 Y5 I5 J0 F9\nG81 Z-1 R1\nG80\nM30\nO2\nG91 G1 X1 Z-.1\nG90\nM99\n%\n",
        ),
        (
            "p.ngc",
            "o<a> sub\nG91 G1 X1\nG90\no<a> endsub\n#7=1\no2 while [#7 LT 3]\n#7=[#7+1]\no3 if [#7 EQ 9]\no2 break\no3 endif\no2 endwhile\nG10 L2 P1 X3\nG0 X0 Y0 Z1 B5\no<a> call\nG3 X0 Y1 R4\nM2\n",
        ),
        (
            "m.nc",
            "O1\nG0 X0 Y0 Z5\n#1=0\nWHILE [#1 LT 3] DO1\n#2=4*COS[#1*90]\nG1 X#2 Y[4*SIN[#1*90]] F90\nIF [#2 EQ #0] GOTO 9\n#1=#1+1\nEND1\nG65 P7 X5. H2\nN9 G51 X0 Y0 P1.5\nG51.1 X3\nG2 X8 I2\nG50\nG68.2 X1 Y2 Z3 I10 J20 K30\nG53.1\nG0 X0 Y0 Z0\nG1 Z-1\nG69\nM30\nO7\nG1 X#24\n#11=#11-1\nIF [#11 GT 0] GOTO 3\nM99\nN3 Z1\nM99\n",
        ),
        (
            "p.cls",
            "TOOL PATH/P,T,MILL\nTLDATA/MILL,6.0,1.0,50,0,0\nLOAD/TOOL,1\nUNITS/MM\nFROM/0,0,9,0,0,1\nRAPID\nGOTO/1,2,3,0,0,1\nCIRCLE/2,2,3,0,0,-1,1,.1\nGOTO/3,2,$\n3\nGOTO/4,4,4,0,0.6,0.8\nCYCLE/DRILL,DEPTH,3,CLEAR,1\nGOTO/5,5,5\nCYCLE/OFF\nGODLTA/1\nFINI\n",
        ),
    ];
    let mut seed = 7u64;
    let mut random = |most: usize| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 33) as usize % most
    };
    let (mut read, mut refused) = (0, 0);
    for n in 0..1500 {
        let (name, text) = programs[n % programs.len()];
        let mut bytes = text.as_bytes().to_vec();
        match n / programs.len() % 3 {
            0 => bytes.truncate(random(bytes.len())),
            1 => (0..1 + random(4)).for_each(|_| {
                let at = random(bytes.len());
                bytes[at] ^= 1 << random(8);
            }),
            _ => {
                let (from, length) = (random(bytes.len() - 9), 1 + random(8));
                let piece = bytes[from..from + length].to_vec();
                let at = random(bytes.len());
                bytes.splice(at..at, piece);
            }
        }
        match read_named(name, &bytes) {
            Ok(program) => {
                read += 1;
                assert!(program.moves.iter().all(|m| m.to.iter().chain(&m.axis).all(|c| c.is_finite())));
            }
            Err(error) => {
                refused += 1;
                assert_eq!(error.to_string().lines().count(), 1, "{error}");
            }
        }
    }
    assert!(read > 100 && refused > 100, "{read} {refused}");
}

#[test]
fn more_moves_than_fit_into_memory_are_refused_with_their_line() {
    let text = format!("G0 X0 Y0 Z0\nG1 F100\n{}", "X1\nX0\n".repeat(5000));
    is_refused("p.nc", &text, &["p.nc: line 5464", "moves do not fit into memory", "`memory`"]);
    is_refused("p.nc", &"(a remark)\n".repeat(100_000), &["p.nc: end", "is larger than 1 MiB"]);
}
