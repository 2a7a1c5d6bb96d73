//! Plots as SVG: logarithmic both ways, medians with their ranges.

use plotters::prelude::*;
use std::error::Error;

/// Pixels; the pages scale it.
const SIZE: (u32, u32) = (760, 420);
/// Blue, orange, green, red, violet, grey: told apart by people who confuse red and green, too.
pub const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
    RGBColor(120, 94, 240),
    RGBColor(110, 110, 110),
];

/// A picture of a report.
pub struct PlotDrawing {
    /// For its file's name.
    pub name: String,
    pub title: String,
    pub svg: String,
}

/// A plot.
pub struct Plot {
    /// For its file's name.
    pub name: &'static str,
    pub title: String,
    /// What is told along x and y, with units.
    pub axes: [&'static str; 2],
    /// Where x has its ticks: at powers of this.
    pub base: f64,
    pub series: Vec<Series>,
}

/// A line of a plot.
pub struct Series {
    pub name: String,
    pub points: Vec<PlotPoint>,
}

/// A median with its range.
#[derive(Clone, Copy)]
pub struct PlotPoint {
    pub x: f64,
    pub y: f64,
    pub low: f64,
    pub high: f64,
}

impl PlotPoint {
    /// Without a range.
    pub fn exact(x: f64, y: f64) -> PlotPoint {
        PlotPoint { x, y, low: y, high: y }
    }
}

impl Plot {
    /// Draws it.
    ///
    /// # Errors
    /// If there is nothing to draw.
    pub fn drawn(self) -> anyhow::Result<PlotDrawing> {
        let svg = self.svg().map_err(|error| anyhow::anyhow!("{}: cannot be drawn: {error}", self.title))?;
        Ok(PlotDrawing { name: self.name.to_owned(), title: self.title, svg })
    }

    fn svg(&self) -> Result<String, Box<dyn Error>> {
        let points = || self.series.iter().flat_map(|series| &series.points);
        let across = limits(points().map(|p| p.x)).ok_or("no points")?;
        let up = limits(points().flat_map(|p| [p.low, p.high])).ok_or("no points")?;
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
            area.fill(&WHITE)?;
            let mut chart = ChartBuilder::on(&area)
                .caption(&self.title, ("sans-serif", 17))
                .margin(12)
                .x_label_area_size(42)
                .y_label_area_size(66)
                .build_cartesian_2d(
                    (across.0..across.1).log_scale().base(self.base),
                    (up.0..up.1).log_scale(),
                )?;
            chart
                .configure_mesh()
                .x_desc(self.axes[0])
                .y_desc(self.axes[1])
                .x_label_formatter(&|&v| tick(v, self.base))
                .y_label_formatter(&|&v| tick(v, 10.0))
                .light_line_style(WHITE)
                .bold_line_style(RGBColor(225, 225, 225))
                .draw()?;
            for (series, colour) in self.series.iter().zip(COLOURS.iter().cycle()) {
                let line = series.points.iter().map(|p| (p.x, p.y));
                chart
                    .draw_series(LineSeries::new(line, colour.stroke_width(2)).point_size(3))?
                    .label(&series.name)
                    .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
                let ranged = series.points.iter().filter(|p| p.low < p.high);
                chart
                    .draw_series(ranged.map(|p| {
                        ErrorBar::new_vertical(p.x, p.low, p.y, p.high, colour.stroke_width(1), 8)
                    }))?;
            }
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::UpperLeft)
                .background_style(WHITE.mix(0.8))
                .border_style(RGBColor(200, 200, 200))
                .draw()?;
            area.present()?;
        }
        Ok(svg)
    }
}

/// The range of positive numbers with some room on both sides.
fn limits(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let fold = |(low, high): (f64, f64), v: f64| (low.min(v), high.max(v));
    let (low, high) = values.filter(|v| v.is_finite() && *v > 0.0).fold((f64::INFINITY, 0.0), fold);
    (high > 0.0).then(|| (low / 1.3, high * 1.3))
}

/// What stands beside a tick: nothing from six on between two powers of ten, where ticks are closer than numbers are wide.
fn tick(value: f64, base: f64) -> String {
    let leading = value / 10f64.powf(value.log10().floor());
    if base == 10.0 && (5.5..9.5).contains(&leading) { String::new() } else { short(value) }
}

/// A number beside an axis: 0.02, 5, 300, 2 k, 45 M.
fn short(value: f64) -> String {
    let (scaled, unit) = match value {
        v if v >= 0.9995e9 => (v / 1e9, " G"),
        v if v >= 0.9995e6 => (v / 1e6, " M"),
        v if v >= 10e3 => (v / 1e3, " k"),
        v => (v, ""),
    };
    // Three digits, without the zeros behind them.
    let digits = (2.0 - scaled.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{scaled:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text}{unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_shows_its_series() {
        let points = vec![PlotPoint { x: 1.0, y: 2.0, low: 1.5, high: 3.0 }, PlotPoint::exact(100.0, 20.0)];
        let series = vec![Series { name: "one <of> them".to_owned(), points }];
        let plot =
            Plot { name: "p", title: "Title".to_owned(), axes: ["across, m", "up, s"], base: 10.0, series };
        let svg = plot.svg().unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{svg}");
        assert!(svg.contains("one &lt;of&gt; them") && svg.contains("across, m") && svg.contains("up, s"));
        let empty = Plot { series: Vec::new(), ..plot };
        assert!(empty.drawn().is_err());
    }

    #[test]
    fn labels_are_short() {
        assert_eq!(
            [0.02, 0.5, 1.0, 5.0, 300.0, 2000.0, 20_000.0, 45e6, 1e9].map(short),
            ["0.02", "0.5", "1", "5", "300", "2000", "20 k", "45 M", "1 G"]
        );
        assert_eq!([5e6, 6e6, 9e6, 1e7].map(|v| tick(v, 10.0)), ["5 M", "", "", "10 M"]);
        assert_eq!([64.0, 512.0].map(|v| tick(v, 2.0)), ["64", "512"]);
    }
}
