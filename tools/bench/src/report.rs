//! `brickfield-bench report`: results as one HTML page, or as Markdown with SVG files beside it.

use crate::args::BenchReportArgs;
use crate::measure::write_file;
use crate::plots::PlotDrawing;
use crate::result::Results;
use crate::sections::{ReportSection, sections};
use crate::table::TextTable;
use brickfield_terminal::failure::Failure;
use brickfield_terminal::output::require_distinct;
use std::path::{Path, PathBuf};

/// The kinds of reports.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum ReportFormat {
    Html,
    Markdown,
}

impl ReportFormat {
    /// By the ending of a name; others are wrong usage.
    pub fn of(path: &Path) -> Result<ReportFormat, Failure> {
        match path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("html" | "htm") => Ok(ReportFormat::Html),
            Some("md") => Ok(ReportFormat::Markdown),
            _ => Err(Failure::Usage(format!("{}: a report ends in .html or .md", path.display()))),
        }
    }
}

/// Runs the command.
pub fn run(args: &BenchReportArgs) -> Result<(), Failure> {
    let format = ReportFormat::of(&args.output)?;
    let inputs: Vec<&Path> = args.results.iter().map(PathBuf::as_path).collect();
    require_distinct(&[&args.output], &inputs)?;
    let results: Vec<Results> = inputs.into_iter().map(Results::read).collect::<Result<_, _>>()?;
    write(&results, &args.output, format)
}

/// Writes the report of these results.
pub fn write(results: &[Results], path: &Path, format: ReportFormat) -> Result<(), Failure> {
    let sections = sections(results)?;
    match format {
        ReportFormat::Html => write_file(path, html(&sections).as_bytes()),
        ReportFormat::Markdown => {
            // The page comes last, so that it never shows plots that are not there.
            let mut text = String::from("# Benchmarks of Brickfield\n");
            for section in &sections {
                text += &format!("\n## {}\n", section.title);
                section.text.iter().for_each(|paragraph| text += &format!("\n{paragraph}\n"));
                section.tables.iter().for_each(|table| text += &format!("\n{}", markdown(table)));
                for plot in &section.plots {
                    let name = plot_name(path, plot);
                    write_file(&path.with_file_name(&name), plot.svg.as_bytes())?;
                    text += &format!("\n![{}]({name})\n", plot.title);
                }
            }
            write_file(path, text.as_bytes())
        }
    }
}

/// `REPORT-plot.svg`.
fn plot_name(report: &Path, plot: &PlotDrawing) -> String {
    let stem = report.file_stem().unwrap_or_default().to_string_lossy();
    format!("{stem}-{}.svg", plot.name)
}

fn markdown(table: &TextTable) -> String {
    let line = |cells: &[String]| {
        let cells = cells.iter().map(|cell| cell.replace('|', "\\|").replace('\n', " "));
        format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "))
    };
    let rule = format!("|{}\n", "---|".repeat(table.head.len()));
    line(&table.head) + &rule + &table.rows.iter().map(|row| line(row)).collect::<String>()
}

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:1100px;padding:0 1em}\
    table{border-collapse:collapse;margin:1em 0;font-size:13px;display:block;overflow-x:auto}\
    th,td{border-bottom:1px solid #ddd;padding:3px 9px;text-align:right;white-space:nowrap}\
    th{border-bottom:2px solid #999}th:nth-child(-n+2),td:nth-child(-n+2){text-align:left}\
    svg{max-width:100%;height:auto}";

fn html(sections: &[ReportSection]) -> String {
    let mut text = format!(
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>Benchmarks of Brickfield</title>\n\
         <style>{STYLE}</style>\n<h1>Benchmarks of Brickfield</h1>\n"
    );
    for section in sections {
        text += &format!("<h2>{}</h2>\n", escaped(&section.title));
        section.text.iter().for_each(|paragraph| text += &format!("<p>{}</p>\n", escaped(paragraph)));
        for table in &section.tables {
            let line = |cells: &[String], tag: &str| {
                let cells = cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell)));
                format!("<tr>{}</tr>\n", cells.collect::<String>())
            };
            let rows: String = table.rows.iter().map(|row| line(row, "td")).collect();
            text += &format!("<table>\n{}{rows}</table>\n", line(&table.head, "th"));
        }
        for plot in &section.plots {
            text += &format!("<figure>{}</figure>\n", plot.svg.trim());
        }
    }
    text + "</html>\n"
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_cannot_break_tables_or_pages() {
        let mut table = TextTable::new(&["a"]);
        table.rows.push(vec!["x|y\nz".to_owned()]);
        assert_eq!(markdown(&table), "| a |\n|---|\n| x\\|y z |\n");
        assert_eq!(escaped("<b>&\""), "&lt;b&gt;&amp;&quot;");
    }
}
