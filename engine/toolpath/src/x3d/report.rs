//! What of a file was read and what was left out.

use std::collections::BTreeMap;
use std::fmt::Write;

/// Nodes that are named one by one; of the rest only the number is kept.
const NAMED: usize = 16;

/// A node that was left out because something is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SkippedNode {
    /// Line of the file, from 1.
    pub line: u64,
    /// The node and what is wrong with it.
    pub what: String,
}

/// Counts of what was read and left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct X3dReport {
    /// Extrusion nodes read.
    pub extrusions: u64,
    /// How often they are placed, by themselves or by USE.
    pub placed: u64,
    /// Extrusions of which nothing is rendered, for their spine has fewer than two distinct points or their
    /// cross-section fewer than two.
    pub empty: u64,
    /// Line of the first of those.
    pub empty_line: u64,
    /// Extrusions whose sweep is closed and was inside out: they are turned over.
    pub turned: u64,
    /// Line of the first of those.
    pub turned_line: u64,
    /// The first nodes that were left out because something is wrong with them.
    pub refused: Vec<SkippedNode>,
    /// Number of all of them.
    pub refused_count: u64,
    /// Nodes that are not read, by name: their number and the line of the first.
    pub skipped: BTreeMap<&'static str, (u64, u64)>,
}

impl X3dReport {
    pub(super) fn refuse(&mut self, line: u64, what: String) {
        self.refused_count += 1;
        if self.refused.len() < NAMED {
            self.refused.push(SkippedNode { line, what });
        }
    }

    pub(super) fn skip(&mut self, line: u64, name: &'static str) {
        self.skipped.entry(name).or_insert((0, line)).0 += 1;
    }

    pub(super) fn turn(&mut self, line: u64) {
        if self.turned == 0 {
            self.turned_line = line;
        }
        self.turned += 1;
    }

    pub(super) fn is_empty(&mut self, line: u64) {
        if self.empty == 0 {
            self.empty_line = line;
        }
        self.empty += 1;
    }

    /// What a user should know, one line each, with the line of the file.
    pub fn warnings(&self) -> Vec<String> {
        let mut lines: Vec<String> =
            self.refused.iter().map(|r| format!("line {}: {}; left out", r.line, r.what)).collect();
        let unnamed = self.refused_count - self.refused.len() as u64;
        if unnamed > 0 {
            lines.push(format!("{unnamed} more nodes with such mistakes left out"));
        }
        if self.empty > 0 {
            lines.push(format!(
                "line {}: {} Extrusion{} of fewer than two distinct points: nothing to render",
                self.empty_line,
                self.empty,
                if self.empty == 1 { "" } else { "s, this the first," },
            ));
        }
        for (name, (count, line)) in &self.skipped {
            let mut text = format!("line {line}: {name} is not read");
            if *count > 1 {
                let _ = write!(text, ", nor are {} more", count - 1);
            }
            lines.push(text);
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_name_the_first_and_count_the_rest() {
        let mut report = X3dReport::default();
        assert!(report.warnings().is_empty());
        for line in 1..=NAMED as u64 + 2 {
            report.refuse(line, "Extrusion: bad".to_owned());
        }
        report.is_empty(40);
        report.is_empty(41);
        report.skip(7, "Box");
        report.skip(9, "Box");
        let lines = report.warnings();
        assert_eq!(lines[0], "line 1: Extrusion: bad; left out");
        assert_eq!(lines[NAMED], "2 more nodes with such mistakes left out");
        assert!(lines[NAMED + 1].starts_with("line 40: 2 Extrusions, this the first,"), "{lines:?}");
        assert_eq!(lines[NAMED + 2], "line 7: Box is not read, nor are 1 more");
        assert_eq!(lines.len(), NAMED + 3);
    }
}
