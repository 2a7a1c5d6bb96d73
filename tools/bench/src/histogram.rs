//! How errors are spread: counts by decade, and their picture, one panel for each who answered.

use crate::plots::{COLOURS, PlotDrawing};
use plotters::prelude::*;
use serde_json::{Map, Value, json};
use std::error::Error;

/// Errors below 10 to this, 0 among them, are the first bin.
const LEAST_DECADE: i32 = -16;
/// Bins: below 10^-16, the 16 decades up to 1, and what is larger.
const BINS: usize = 18;

/// Pixels: the width, the height of a panel, and what the numbers along the axis take below the last.
const WIDTH: u32 = 760;
const PANEL: u32 = 110;
const LABELS: u32 = 46;

/// The name of a histogram among what is told of an answer.
const FACT: &str = "error_histogram";

/// Counts of errors by decade, of one who answered.
#[derive(Debug, PartialEq, Eq)]
pub struct Histogram {
    counts: [u64; BINS],
}

/// A histogram with what is told of it.
pub struct Panel {
    pub title: String,
    pub histogram: Histogram,
}

impl Histogram {
    /// Of errors, none of them below 0; what is no number counts as large.
    pub fn of(errors: &[f64]) -> Histogram {
        let mut counts = [0; BINS];
        for error in errors {
            counts[bin_of(*error)] += 1;
        }
        Histogram { counts }
    }

    /// Enters it into what is told of an answer: the decades at which bins begin, and their counts.
    pub fn tell(&self, facts: &mut Map<String, Value>) {
        let first = json!({"below": format!("1e{LEAST_DECADE}"), "samples": self.counts[0]});
        let rest = (1..BINS).map(|bin| json!({"from": edge(bin), "samples": self.counts[bin]}));
        facts.insert(FACT.to_owned(), std::iter::once(first).chain(rest).collect());
    }

    /// What was entered, if it is whole.
    pub fn told(facts: &Map<String, Value>) -> Option<Histogram> {
        let bins = facts.get(FACT)?.as_array()?;
        let counts: Option<Vec<u64>> = bins.iter().map(|bin| bin.get("samples")?.as_u64()).collect();
        Some(Histogram { counts: counts?.try_into().ok()? })
    }

    /// The bins that hold anything.
    fn used(&self) -> impl Iterator<Item = usize> {
        (0..BINS).filter(|&bin| self.counts[bin] > 0)
    }
}

/// Where an error counts.
fn bin_of(error: f64) -> usize {
    if error.is_nan() {
        return BINS - 1;
    }
    let decade = error.log10().floor().clamp(f64::from(LEAST_DECADE - 1), 0.0);
    (decade as i32 - LEAST_DECADE + 1) as usize
}

/// Where a bin but the first begins, as a number is written.
fn edge(bin: usize) -> String {
    match LEAST_DECADE + bin as i32 - 1 {
        0 => "1".to_owned(),
        decade => format!("1e{decade}"),
    }
}

/// Draws panels below each other, over the same bins.
///
/// # Errors
/// If there is nothing to draw.
pub fn draw(name: String, title: String, panels: &[Panel]) -> anyhow::Result<PlotDrawing> {
    let svg = svg(&title, panels).map_err(|error| anyhow::anyhow!("{title}: cannot be drawn: {error}"))?;
    Ok(PlotDrawing { name, title, svg })
}

fn svg(title: &str, panels: &[Panel]) -> Result<String, Box<dyn Error>> {
    let used = || panels.iter().flat_map(|panel| panel.histogram.used());
    let (first, last) = (used().min().ok_or("no errors")?, used().max().ok_or("no errors")?);
    let (low, high) = (first as f64, last as f64 + 1.0);
    let mut svg = String::new();
    {
        let size = (WIDTH, PANEL * panels.len() as u32 + LABELS + 30);
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        area.fill(&WHITE)?;
        let area = area.titled(title, ("sans-serif", 17))?;
        let below: Vec<i32> = (1..panels.len() as i32).map(|panel| PANEL as i32 * panel).collect();
        let areas = area.split_by_breakpoints::<i32, i32, _, _>([], below);
        for (number, (panel, area)) in panels.iter().zip(&areas).enumerate() {
            let is_last = number + 1 == panels.len();
            let counts = &panel.histogram.counts;
            let most = counts.iter().max().copied().unwrap_or(0).max(1) as f64;
            let mut chart = ChartBuilder::on(area)
                .caption(&panel.title, ("sans-serif", 13))
                .margin_left(12)
                .margin_right(12)
                .margin_top(4)
                .x_label_area_size(if is_last { LABELS } else { 6 })
                .y_label_area_size(50)
                .build_cartesian_2d(low..high, 0.0..1.05 * most)?;
            chart
                .configure_mesh()
                .disable_x_mesh()
                .x_labels(if is_last { BINS + 1 } else { 0 })
                .y_labels(3)
                .x_desc(if is_last { "error" } else { "" })
                .y_desc("samples")
                .x_label_formatter(&|&at| if at < 0.5 { "0".to_owned() } else { edge(at.round() as usize) })
                .y_label_formatter(&|&count| format!("{count:.0}"))
                .light_line_style(WHITE)
                .bold_line_style(RGBColor(225, 225, 225))
                .draw()?;
            let colour = COLOURS[number % COLOURS.len()];
            chart.draw_series(panel.histogram.used().map(|bin| {
                let (left, right) = (bin as f64 + 0.06, bin as f64 + 0.94);
                Rectangle::new([(left, 0.0), (right, counts[bin] as f64)], colour.filled())
            }))?;
        }
        area.present()?;
    }
    Ok(svg)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_fall_into_their_decades() {
        let errors = [0.0, 1e-20, 1.5e-16, 0.02, 0.09, 0.2, 1.0, 1e9, f64::INFINITY, f64::NAN];
        let histogram = Histogram::of(&errors);
        let used: Vec<(usize, u64)> = histogram.used().map(|bin| (bin, histogram.counts[bin])).collect();
        assert_eq!(used, [(0, 2), (1, 1), (15, 2), (16, 1), (17, 4)]);
        assert_eq!((edge(1), edge(16), edge(17)), ("1e-16".to_owned(), "1e-1".to_owned(), "1".to_owned()));
    }

    #[test]
    fn what_is_told_is_read_and_drawn() {
        let mut facts = Map::new();
        assert_eq!(Histogram::told(&facts), None);
        let histogram = Histogram::of(&[0.0, 0.01, 0.02]);
        histogram.tell(&mut facts);
        assert_eq!(facts[FACT][15], json!({"from": "1e-2", "samples": 2}));
        assert_eq!(Histogram::told(&facts).as_ref(), Some(&histogram));
        let panel = |title: &str| Panel { title: title.to_owned(), histogram: Histogram::of(&[0.0, 0.02]) };
        let drawn =
            draw("n".to_owned(), "Errors".to_owned(), &[panel("one <of> them"), panel("two")]).unwrap();
        assert!(drawn.svg.contains("one &lt;of&gt; them") && drawn.svg.contains("1e-2"), "{}", drawn.svg);
        assert!(draw("n".to_owned(), "Errors".to_owned(), &[]).is_err());
        facts.insert(FACT.to_owned(), json!([1]));
        assert_eq!(Histogram::told(&facts), None);
    }
}
