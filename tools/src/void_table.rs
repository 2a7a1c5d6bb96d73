//! Tables of voids, as `brickfield voids` writes them, read again.

use crate::failure::Failure;
use crate::output::in_line;
use anyhow::{Context, anyhow};
use brickfield_engine::voids::Void;
use serde_json::Value;
use std::path::Path;

/// Where a void lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoidPlace {
    pub id: u64,
    pub centre: [f64; 3],
    pub low: [f64; 3],
    pub high: [f64; 3],
}

impl VoidPlace {
    /// Where a void that was found lies.
    #[cfg_attr(not(feature = "view"), allow(dead_code))]
    pub fn of(void: &Void) -> VoidPlace {
        let [low, high] = void.bounds;
        VoidPlace { id: void.id as u64, centre: void.centroid, low, high }
    }
}

/// Columns that are read.
const COLUMNS: [&str; 10] = ["id", "x", "y", "z", "xmin", "ymin", "zmin", "xmax", "ymax", "zmax"];

/// The voids of a table, in its order; CSV or JSON by the ending.
///
/// # Errors
/// If it cannot be read, or is no table of voids.
pub fn read(path: &Path) -> Result<Vec<VoidPlace>, Failure> {
    let name = in_line(path);
    let text =
        std::fs::read_to_string(path).with_context(|| format!("{name}: cannot read the table of voids"))?;
    let is_json = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
    let rows = if is_json { of_json(&text) } else { of_csv(&text) };
    let wrong = |what: String| anyhow!("{name}: {what}; give a table that `brickfield voids` wrote").into();
    rows.map_err(wrong)
}

fn place(values: [f64; 10]) -> VoidPlace {
    let [id, x, y, z, low_x, low_y, low_z, high_x, high_y, high_z] = values;
    VoidPlace { id: id as u64, centre: [x, y, z], low: [low_x, low_y, low_z], high: [high_x, high_y, high_z] }
}

fn of_json(text: &str) -> Result<Vec<VoidPlace>, String> {
    let document: Value = serde_json::from_str(text).map_err(|error| format!("it is no JSON: {error}"))?;
    let rows = document["voids"].as_array().ok_or("it has no list `voids`")?;
    let row = |(number, row): (usize, &Value)| {
        let mut values = [0.0; COLUMNS.len()];
        for (value, column) in values.iter_mut().zip(COLUMNS) {
            *value = row[column]
                .as_f64()
                .ok_or(format!("void {} of the list has no number `{column}`", number + 1))?;
        }
        Ok(place(values))
    };
    rows.iter().enumerate().map(row).collect()
}

fn of_csv(text: &str) -> Result<Vec<VoidPlace>, String> {
    let mut lines = text.lines().enumerate();
    let header = cells(lines.next().ok_or("it is empty")?.1);
    let mut columns = [0; COLUMNS.len()];
    for (place, column) in columns.iter_mut().zip(COLUMNS) {
        *place =
            header.iter().position(|name| name == column).ok_or(format!("it has no column `{column}`"))?;
    }
    let row = |line: &str| {
        let cells = cells(line);
        let mut values = [0.0; COLUMNS.len()];
        for (value, (column, name)) in values.iter_mut().zip(columns.iter().zip(COLUMNS)) {
            let number =
                cells.get(*column).and_then(|cell| cell.parse::<f64>().ok()).filter(|v| v.is_finite());
            *value = number.ok_or(format!("`{name}` is no number"))?;
        }
        Ok(place(values))
    };
    let numbered = |(number, line): (usize, &str)| {
        row(line).map_err(|what: String| format!("line {}: {what}", number + 1))
    };
    lines.filter(|(_, line)| !line.is_empty()).map(numbered).collect()
}

/// The cells of a line, quoted ones without their quotes.
fn cells(line: &str) -> Vec<String> {
    let mut cells = vec![String::new()];
    let mut is_quoted = false;
    for c in line.chars() {
        match c {
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => cells.push(String::new()),
            c => cells.iter_mut().last().into_iter().for_each(|cell| cell.push(c)),
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_read_or_refused_in_a_line() {
        let csv = "id,class,x,y,z,xmin,ymin,zmin,xmax,ymax,zmax\n1,\"a,b\",1,2,3,0,1,2,2,3,4\n";
        let expected =
            VoidPlace { id: 1, centre: [1.0, 2.0, 3.0], low: [0.0, 1.0, 2.0], high: [2.0, 3.0, 4.0] };
        assert_eq!(of_csv(csv), Ok(vec![expected]));
        let json =
            r#"{"voids":[{"id":1,"x":1,"y":2,"z":3,"xmin":0,"ymin":1,"zmin":2,"xmax":2,"ymax":3,"zmax":4}]}"#;
        assert_eq!(of_json(json), Ok(vec![expected]));
        assert!(of_csv("a,b\n1,2\n").unwrap_err().contains("column `id`"));
        assert!(of_csv("id,x,y,z,xmin,ymin,zmin,xmax,ymax,zmax\n1,2\n").unwrap_err().contains("line 2"));
        assert!(of_csv("").is_err() && of_json("{").is_err() && of_json("{}").is_err());
    }
}
