//! Figures for people.

use crate::result::{Figure, InputFact, Results, RoundSpread};
use brickfield_terminal::units::Size;
use serde_json::Value;
use std::fmt::Write;

/// A table of text, in a terminal, Markdown or HTML.
pub struct TextTable {
    pub head: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl TextTable {
    /// With these columns.
    pub fn new(head: &[&str]) -> TextTable {
        TextTable { head: head.iter().map(|&name| name.to_owned()).collect(), rows: Vec::new() }
    }

    /// In columns, all but the first two flush right.
    pub fn aligned(&self) -> String {
        let lines = || std::iter::once(&self.head).chain(&self.rows);
        let width = |column: usize| lines().map(|line| line[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.head.len()).map(width).collect();
        let mut text = String::new();
        for line in lines() {
            let mut told = String::new();
            for (column, (cell, width)) in line.iter().zip(&widths).enumerate() {
                let space = " ".repeat(width - cell.chars().count());
                told += &if column < 2 { format!("{cell}{space}  ") } else { format!("{space}{cell}  ") };
            }
            text += told.trim_end();
            text.push('\n');
        }
        text
    }
}

/// All figures of a result.
pub fn of(results: &Results) -> String {
    let mut text = heading(results);
    for suite in &results.settings.suites {
        let _ = write!(text, "\n{suite}\n{}", of_suite(results, suite).aligned());
    }
    text
}

/// What was measured on what, in a few lines.
pub fn heading(results: &Results) -> String {
    let Results { program, commit, date, machine, settings, seconds, input_seconds, load, .. } = results;
    let commit = commit.as_ref().map_or(String::new(), |commit| format!(" ({commit})"));
    let memory = machine.memory_bytes.map_or(String::new(), |bytes| format!(", {} of memory", Size(bytes)));
    let size = if settings.quick {
        "quick, "
    } else if settings.full {
        "full, "
    } else {
        ""
    };
    let limits = results.limits.iter();
    let limits = (!results.limits.is_empty()).then(|| {
        let bytes = RoundSpread::of(limits.clone().map(|limits| limits.bytes_per_second));
        let operations = RoundSpread::of(limits.map(|limits| limits.operations_per_second));
        let [bytes, operations] = [bytes, operations]
            .map(|spread| format!("{} ({})", number(spread.median / 1e9), range(spread.scaled(1e-9))));
        format!("at best {bytes} GB/s from memory, {operations} billion operations/s\n")
    });
    format!(
        "{program}{commit}, {date}: {size}{} rounds with {} threads in {seconds:.0} s, \
         {input_seconds:.0} s of it for inputs\n{}, {} cores{memory}, {}, load {:.1} before and {:.1} after\n{}",
        settings.rounds,
        settings.threads,
        machine.cpu,
        machine.cores,
        machine.kernel,
        load[0],
        load[1],
        limits.unwrap_or_default()
    )
}

/// The figures of a suite.
pub fn of_suite(results: &Results, suite: &str) -> TextTable {
    let mut table = TextTable::new(&[
        "input", "job", "seconds", "(range)", "floors", "(range)", "limits", "cpu s", "memory", "result",
    ]);
    for figure in results.figures.iter().filter(|figure| figure.suite == suite) {
        if let Some(why) = &figure.failed {
            let mut row = vec![figure.input.clone(), figure.job.clone()];
            row.resize(table.head.len() - 1, "–".to_owned());
            row.push(format!("failed: {why}"));
            table.rows.push(row);
            continue;
        }
        let (seconds, floors) = (figure.seconds(), figure.floors());
        let job =
            if figure.extrapolated { format!("{} (extrapolated)", figure.job) } else { figure.job.clone() };
        table.rows.push(vec![
            figure.input.clone(),
            job,
            number(seconds.median),
            range(seconds),
            unless_extrapolated(figure, number(floors.median)),
            unless_extrapolated(figure, range(floors)),
            results
                .in_limits(figure)
                .map_or("–".to_owned(), |(ratio, of)| format!("{} {of}", number(ratio))),
            Some(figure.cpu_seconds().median).filter(|&cpu| cpu > 0.0).map_or("–".to_owned(), number),
            memory(figure),
            facts(figure),
        ]);
    }
    table
}

/// The inputs of results, each once.
pub fn of_inputs(results: &[Results]) -> TextTable {
    let mut table = TextTable::new(&["input", "FNV-1a", "bytes", "triangles"]);
    for InputFact { name, bytes, triangles, fnv1a } in results.iter().flat_map(|result| &result.inputs) {
        let triangles = triangles.map_or(String::new(), |count| count.to_string());
        let row = vec![name.clone(), fnv1a.clone(), bytes.to_string(), triangles];
        if !table.rows.contains(&row) {
            table.rows.push(row);
        }
    }
    table
}

/// Three digits that matter.
pub fn number(value: f64) -> String {
    let digits = match value.abs() {
        v if v == 0.0 || v >= 100.0 => 0,
        v if v >= 10.0 => 1,
        v if v >= 1.0 => 2,
        v if v >= 0.1 => 3,
        _ => 4,
    };
    format!("{value:.digits$}")
}

/// From the least to the greatest.
pub fn range(spread: RoundSpread) -> String {
    if spread.rounds < 2 {
        "one round".to_owned()
    } else {
        format!("{} to {}", number(spread.min), number(spread.max))
    }
}

/// The floor of an input says nothing of what was not measured as a whole.
fn unless_extrapolated(figure: &Figure, text: String) -> String {
    if figure.extrapolated { "–".to_owned() } else { text }
}

/// The most that was seen.
pub fn memory(figure: &Figure) -> String {
    match figure.anonymous_bytes() {
        0 => "not seen".to_owned(),
        bytes => Size(bytes).to_string(),
    }
}

/// What the job told that says how much was done.
fn facts(figure: &Figure) -> String {
    let told =
        [("triangles", "triangles"), ("leaves", "leaves"), ("records", "records"), ("file_bytes", "bytes")];
    let known = told.iter().filter_map(|(name, of)| Some(format!("{} {of}", figure.facts.get(*name)?)));
    let mut told: Vec<String> = known.collect();
    let fact = |name: &str| figure.facts.get(name).and_then(Value::as_f64);
    if let (Some(rms), Some(worst), Some(wrong), Some(judged)) =
        (fact("rms_error"), fact("worst_error"), fact("wrong_side"), fact("judged"))
    {
        told.push(format!("error {rms:.1e} rms, {worst:.1e} at most, {wrong} of {judged} on the wrong side"));
    }
    if let (Some(width), Some(p999), Some(max), Some(clear)) = (
        fact("width_cells"),
        fact("mesh_p999_widths"),
        fact("mesh_max_widths"),
        fact("boundary_clear_p999_widths"),
    ) {
        told.push(format!(
            "a width is {width:.1} cells; in widths 99.9 % of the mesh are within {p999:.3} of the truth, all within \
             {max:.3}, 99.9 % of the truth at gaps of 2 cells and more within {clear:.3} of the mesh"
        ));
    }
    told.extend(fact("pairs").map(|pairs| format!("{pairs} pairs of triangles meet")));
    told.extend(fact("volume").map(|volume| format!("volume {volume:.1}")));
    told.extend(
        figure.facts.get("version").and_then(Value::as_str).map(|version| format!("version {version}")),
    );
    told.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        let texts = [0.0, 0.01234, 0.1234, 1.234, 12.34, 123.4, 12_345.6].map(number);
        assert_eq!(texts, ["0", "0.0123", "0.123", "1.23", "12.3", "123", "12346"]);
    }

    #[test]
    fn columns_stand_below_each_other() {
        let mut table = TextTable::new(&["a", "b", "c"]);
        table.rows.push(["ü", "long", "10"].map(str::to_owned).into());
        assert_eq!(table.aligned(), "a  b      c\nü  long  10\n");
    }
}
