//! What a report tells: tables and plots of results.

use crate::contours;
use crate::histogram::{self, Histogram, Panel};
use crate::paper::{Row, SAMPLES, TABLE_3};
use crate::peers::PEERS;
use crate::plots::{Plot, PlotDrawing, PlotPoint, Series};
use crate::result::{Figure, Results};
use crate::table::{self, TextTable, number};

/// A part of a report.
pub struct ReportSection {
    pub title: String,
    pub text: Vec<String>,
    pub tables: Vec<TextTable>,
    pub plots: Vec<PlotDrawing>,
}

/// All of a report.
///
/// # Errors
/// If a plot cannot be drawn.
pub fn sections(results: &[Results]) -> anyhow::Result<Vec<ReportSection>> {
    let mut sections = Vec::new();
    for (number, result) in results.iter().enumerate() {
        let of = if results.len() > 1 { format!(", result {}", number + 1) } else { String::new() };
        let mut text: Vec<String> = table::heading(result).lines().map(str::to_owned).collect();
        text.push(HOW.to_owned());
        sections.push(ReportSection {
            title: format!("Measured on{of}"),
            text,
            tables: Vec::new(),
            plots: Vec::new(),
        });
        for suite in &result.settings.suites {
            let mut section = ReportSection {
                title: format!("{suite}{of}"),
                text: Vec::new(),
                tables: vec![table::of_suite(result, suite)],
                plots: Vec::new(),
            };
            if suite == "paper" {
                section.text.push(PAPER.to_owned());
                section.tables.insert(0, table_3(result));
            }
            if suite == PEERS {
                section.text.push(ERRORS.to_owned());
                let contours = contours::table(result);
                if !contours.rows.is_empty() {
                    section.text.push(CONTOURS.to_owned());
                    section.tables.push(contours);
                }
                let of = if results.len() > 1 { format!("{}-", number + 1) } else { String::new() };
                section.plots = errors(result, &of)?;
            }
            sections.push(section);
        }
    }
    let plots = plots(results).into_iter().map(Plot::drawn).collect::<anyhow::Result<Vec<PlotDrawing>>>()?;
    if !plots.is_empty() {
        sections.push(ReportSection {
            title: "Plots".to_owned(),
            text: Vec::new(),
            tables: Vec::new(),
            plots,
        });
    }
    let tables = vec![table::of_inputs(results)];
    sections.push(ReportSection { title: "Inputs".to_owned(), text: Vec::new(), tables, plots: Vec::new() });
    Ok(sections)
}

const HOW: &str = "Times are those of whole commands, started anew for each round: medians, with ranges over rounds. \
    Floors are times divided by the read floor of the input, measured just before in the same round: streaming the \
    file with all cores and snapping every vertex in plain code. Limits are times divided by the least that the machine \
    needs: reading from memory, once, the bytes of the files that are read whole and of those that are written, at the \
    speed of a plain sum over 256 MiB with all threads; or the operations of the sum over all triangles (67 a pair of \
    sample and triangle, roots and the arc tangent counted as one) at that of plain multiplications and additions in \
    double precision; measured in the same run. Memory is the largest RssAnon of the process.";

const PAPER: &str = "Peelar et al. 2019, Table 3: the sum over all triangles on a GTX 1080 Ti, upload to download. \
    Here: from the file of triangles to the file of samples, with a store between, on inputs of about the size. 96³ \
    has no level of its own: the root cube has 128³, of which the input spans 96. Brute force is this program's sum in \
    double precision over all triangles at a few points, extrapolated to all samples.";

const ERRORS: &str = "Times of peers are without reading their input, this program's with it. Errors are those of \
    samples at random within the input's box against the sum of solid angles over all triangles in double precision, \
    whose own rounding is 1e-15 to 1e-13.";

const CONTOURS: &str = "Last, contouring alone: of peers from a field in memory, of this program from the store, to arrays \
    in memory and to a durable file. Their field holds signed distances to this program's uniform mesh in cells, cut off at \
    three, at the samples of the store; processor time is of contouring alone, and memory is without the field, which is \
    mapped, but for OpenVDB, whose own grid counts. fidget meshes a function, the maxima of the planes of the convex pieces of \
    the part. Pairs of triangles that meet where they must not are those of `mesh --check`.";

/// Errors of all who gave winding numbers, a picture for each input.
fn errors(result: &Results, of: &str) -> anyhow::Result<Vec<PlotDrawing>> {
    let mut inputs: Vec<(&str, Vec<Panel>)> = Vec::new();
    for figure in result.figures.iter().filter(|figure| figure.suite == PEERS) {
        let Some(histogram) = Histogram::told(&figure.facts).filter(|_| !figure.rounds.is_empty()) else {
            continue;
        };
        let note = if figure.extrapolated { ", extrapolated" } else { "" };
        let title = format!("{}: {} s{note}", figure.job, number(figure.seconds().median));
        let panel = Panel { title, histogram };
        match inputs.iter_mut().find(|(input, _)| *input == figure.input) {
            Some((_, panels)) => panels.push(panel),
            None => inputs.push((&figure.input, vec![panel])),
        }
    }
    let drawn = |(input, panels): (&str, Vec<Panel>)| {
        let name = format!("errors-{of}{}", input.trim_end_matches(".stl"));
        histogram::draw(name, format!("Errors of winding numbers of {input}, and times"), &panels)
    };
    inputs.into_iter().map(drawn).collect()
}

/// The paper's table with ours beside.
fn table_3(result: &Results) -> TextTable {
    let mut table = TextTable::new(&["input", "what", "32³", "64³", "96³", "128³"]);
    for row in &TABLE_3 {
        let figures: Vec<&Figure> =
            result.figures.iter().filter(|f| f.suite == "paper" && f.input == row.input.name).collect();
        if figures.is_empty() {
            continue;
        }
        let of = |name: &str| SAMPLES.map(|samples| job(&figures, &format!("{name} {samples}³")));
        let mut line = |input: String, what: String, cells: [String; 4]| {
            table.rows.push([vec![input, what], cells.to_vec()].concat());
        };
        let Row { name, megabytes, seconds, input, .. } = row;
        line(format!("{name}, {megabytes} MB"), "Peelar et al., s".to_owned(), seconds.map(number));
        let bytes = result.inputs.iter().find(|fact| fact.name == input.name).map_or(0, |fact| fact.bytes);
        let ours = format!("{}, {:.0} MB", input.name, bytes as f64 / 1e6);
        let told = |figure: Option<&&Figure>, of: &dyn Fn(&Figure) -> f64| {
            figure.map_or("not measured".to_owned(), |figure| number(of(figure)))
        };
        let dense = of("dense");
        line(
            ours,
            "build and export, s".to_owned(),
            dense.map(|f| told(f.as_ref(), &|f| f.seconds().median)),
        );
        line(
            String::new(),
            "in read floors".to_owned(),
            dense.map(|f| told(f.as_ref(), &|f| f.floors().median)),
        );
        let limits = dense.map(|f| f.and_then(|f| result.in_limits(f)));
        if limits.iter().any(Option::is_some) {
            let told = limits.map(|limit| limit.map_or("–".to_owned(), |(ratio, _)| number(ratio)));
            line(String::new(), "in limits of memory".to_owned(), told);
        }
        let ratios = std::array::from_fn(|i| told(dense[i].as_ref(), &|f| seconds[i] / f.seconds().median));
        line(String::new(), "times as fast as Peelar et al.".to_owned(), ratios);
        for name in ["brute force", "brute force on the GPU"] {
            let brute = of(name);
            if brute.iter().any(Option::is_some) {
                let told = brute.map(|f| told(f.as_ref(), &|f| f.seconds().median));
                line(String::new(), format!("{name} here, extrapolated, s"), told);
            }
        }
    }
    table
}

fn job<'a>(figures: &[&'a Figure], name: &str) -> Option<&'a Figure> {
    figures.iter().copied().find(|figure| figure.job == name)
}

/// Plots of all results together.
fn plots(results: &[Results]) -> Vec<Plot> {
    let builds = |title: &str, axes, varied: &'static str, points: &dyn Fn(&Figure) -> Option<PlotPoint>| {
        let base = if varied == "triangles" { 10.0 } else { 2.0 };
        let of = |result| Series { name: name_of(result), points: series(result, varied, points) };
        let series: Vec<Series> = results.iter().map(of).filter(|series| series.points.len() > 1).collect();
        (!series.is_empty()).then(|| Plot { name: varied, title: title.to_owned(), axes, base, series })
    };
    let seconds = |x: f64, figure: &Figure| {
        let spread = figure.seconds();
        PlotPoint { x, y: spread.median, low: spread.min, high: spread.max }
    };
    let by_triangles =
        builds("Build at one depth, by triangles", ["triangles", "seconds"], "triangles", &|f| {
            Some(seconds(f.at("triangles")?, f))
        });
    let by_depth =
        builds("Build of one pile, by depth", ["cells along the longest side", "seconds"], "depth", &|f| {
            Some(seconds(32.0 * f.at("depth")?.exp2(), f))
        });
    let by_threads =
        builds("Throughput of a build, by threads", ["threads", "triangles a second"], "threads", &|f| {
            let (spread, triangles) = (f.seconds(), f.at("triangles")?);
            let rate = |seconds: f64| triangles / seconds;
            Some(PlotPoint {
                x: f.at("threads")?,
                y: rate(spread.median),
                low: rate(spread.max),
                high: rate(spread.min),
            })
        });
    let mut by_memory = builds(
        "Memory of a build, by what --memory allows",
        ["allowed, MiB", "anonymous memory, MiB"],
        "memory",
        &|f| {
            let most = f.anonymous_bytes() as f64 / MIB;
            (most > 0.0).then(|| Some(PlotPoint::exact(f.at("memory")? / MIB, most)))?
        },
    );
    if let Some(plot) = &mut by_memory {
        let points: Vec<PlotPoint> =
            plot.series[0].points.iter().map(|p| PlotPoint::exact(p.x, p.x)).collect();
        plot.series.push(Series { name: "allowed".to_owned(), points });
    }
    let paper = results.first().and_then(paper_plot);
    [paper, by_triangles, by_depth, by_threads, by_memory].into_iter().flatten().collect()
}

const MIB: f64 = 1024.0 * 1024.0;

/// The figures along one axis, in order: those of the series, and the builds of the same input and depth that are
/// another series' but differ from them in nothing else.
fn series(result: &Results, varied: &str, point: &dyn Fn(&Figure) -> Option<PlotPoint>) -> Vec<PlotPoint> {
    let own = |figure: &&Figure| figure.series.as_deref() == Some(varied);
    let Some(first) = result.figures.iter().find(own) else { return Vec::new() };
    let belongs = |figure: &&Figure| {
        let same = |name: &str| name == varied || figure.at.get(name) == first.at.get(name);
        let input = varied == "triangles" || figure.input == first.input;
        own(figure)
            || figure.suite == first.suite && input && ["depth", "threads", "memory"].into_iter().all(same)
    };
    let mut points: Vec<PlotPoint> = result.figures.iter().filter(belongs).filter_map(point).collect();
    points.sort_by(|a, b| a.x.total_cmp(&b.x));
    points
}

/// Times by samples of the largest row that was measured.
fn paper_plot(result: &Results) -> Option<Plot> {
    let of = |row: &Row| -> Vec<&Figure> {
        result.figures.iter().filter(|f| f.suite == "paper" && f.input == row.input.name).collect()
    };
    let row = TABLE_3.iter().rfind(|row| !of(row).is_empty())?;
    let figures = of(row);
    let ours = |name: &str, told: &str| {
        let point = |samples: u64| {
            let spread = job(&figures, &format!("{name} {samples}³"))?.seconds();
            Some(PlotPoint { x: samples as f64, y: spread.median, low: spread.min, high: spread.max })
        };
        Series { name: told.to_owned(), points: SAMPLES.into_iter().filter_map(point).collect() }
    };
    let theirs =
        SAMPLES.iter().zip(row.seconds).map(|(&samples, seconds)| PlotPoint::exact(samples as f64, seconds));
    let series = vec![
        ours("dense", "build and export"),
        Series { name: format!("Peelar et al. 2019, {}", row.name), points: theirs.collect() },
        ours("brute force", "brute force here, extrapolated"),
    ];
    Some(Plot {
        name: "paper",
        title: format!("Dense samples of {}", row.input.name),
        axes: ["samples an axis", "seconds"],
        base: 2.0,
        series: series.into_iter().filter(|series| series.points.len() > 1).collect(),
    })
}

/// A result in a legend.
fn name_of(result: &Results) -> String {
    result.commit.clone().unwrap_or_else(|| result.program.clone())
}
