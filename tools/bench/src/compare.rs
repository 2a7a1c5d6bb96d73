//! `brickfield-bench compare`: what differs between two results beyond the noise of their rounds.

use crate::args::BenchCompareArgs;
use crate::peers::PEERS;
use crate::result::{Figure, Results, RoundSpread};
use crate::table::number;
use anyhow::anyhow;
use brickfield_terminal::failure::Failure;
use brickfield_terminal::output::{in_line, print, print_json};
use serde::Serialize;

/// Less than this is no difference, however steady the rounds.
const LEAST_NOISE: f64 = 0.02;
/// What is taken for noise where too few rounds tell.
const UNKNOWN_NOISE: f64 = 0.25;
/// Rounds that tell something of noise.
const ROUNDS_TO_TELL: usize = 3;
/// The standard deviation of a normal distribution over its median absolute deviation.
const SIGMA_OF_DEVIATION: f64 = 1.4826;
/// The standard error of a median over that of a mean, of a normal distribution.
const ERROR_OF_MEDIAN: f64 = 1.2533;
/// How many standard errors are beyond noise.
const ERRORS_BEYOND: f64 = 3.0;

/// What became of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Verdict {
    Same,
    Slower,
    Faster,
    /// The job told another result.
    OtherResult,
    /// Not comparable: the input has other bytes.
    OtherInput,
}

/// A figure that both results have.
#[derive(Serialize)]
struct Compared {
    figure: String,
    verdict: Verdict,
    before: RoundSpread,
    after: RoundSpread,
    /// Median after over median before.
    ratio: f64,
    /// The same of times in read floors.
    floors_ratio: f64,
    /// Share of the median that is taken for noise.
    noise: f64,
    /// Most anonymous memory after over that before; null if one is unknown.
    memory_ratio: Option<f64>,
}

/// What is printed as JSON.
#[derive(Serialize)]
struct Comparison {
    before: String,
    after: String,
    same_machine: bool,
    equal: bool,
    /// Ratios of all figures of the same input and result.
    ratio: Option<RoundSpread>,
    /// And their noise.
    noise: Option<RoundSpread>,
    figures: Vec<Compared>,
    only_before: Vec<String>,
    only_after: Vec<String>,
}

/// Runs the command.
pub fn run(args: &BenchCompareArgs) -> Result<(), Failure> {
    let (before, after) = (Results::read(&args.before)?, Results::read(&args.after)?);
    let missing_in = |of: &Results, other: &Results| -> Vec<String> {
        let ids: Vec<String> = other.figures.iter().map(Figure::id).collect();
        of.figures.iter().map(Figure::id).filter(|id| !ids.contains(id)).collect()
    };
    let figures: Vec<Compared> = before
        .figures
        .iter()
        .filter_map(|a| {
            let b = after.figures.iter().find(|b| b.id() == a.id())?;
            // Peers that failed have no times.
            if a.rounds.is_empty() || b.rounds.is_empty() {
                return None;
            }
            let same_input = before.input(a).map(|i| &i.fnv1a) == after.input(b).map(|i| &i.fnv1a);
            Some(compare(a, b, same_input))
        })
        .collect();
    let names = [in_line(&args.before), in_line(&args.after)];
    if figures.is_empty() {
        let [a, b] = names;
        return Err(anyhow!("{a} and {b} have no figure in common; measure the same suites").into());
    }
    let equal = figures.iter().all(|figure| figure.verdict == Verdict::Same);
    let of_all = |value: fn(&Compared) -> f64| {
        let other = [Verdict::OtherResult, Verdict::OtherInput];
        let values: Vec<f64> =
            figures.iter().filter(|figure| !other.contains(&figure.verdict)).map(value).collect();
        (!values.is_empty()).then(|| RoundSpread::of(values.into_iter()))
    };
    let [a, b] = names;
    let comparison = Comparison {
        same_machine: before.machine == after.machine,
        equal,
        ratio: of_all(|figure| figure.ratio),
        noise: of_all(|figure| figure.noise),
        figures,
        only_before: missing_in(&before, &after),
        only_after: missing_in(&after, &before),
        before: a,
        after: b,
    };
    if args.json {
        print_json(&comparison)?;
    } else {
        print(&as_text(&comparison))?;
    }
    if equal { Ok(()) } else { Err(anyhow!(summary(&comparison)).into()) }
}

fn compare(a: &Figure, b: &Figure, same_input: bool) -> Compared {
    let (before, after) = (a.seconds(), b.seconds());
    let ratio = after.median / before.median;
    let noise = noise(before, after);
    let apart = before.max < after.min || after.max < before.min;
    let beyond = apart && ratio.ln().abs() > (1.0 + noise).ln();
    let verdict = match (same_input, a.facts == b.facts || a.suite == PEERS) {
        (false, _) => Verdict::OtherInput,
        (true, false) => Verdict::OtherResult,
        (true, true) if beyond && ratio > 1.0 => Verdict::Slower,
        (true, true) if beyond => Verdict::Faster,
        (true, true) => Verdict::Same,
    };
    let memory = [a, b].map(|figure| Some(figure.anonymous_bytes() as f64).filter(|&bytes| bytes > 0.0));
    Compared {
        figure: a.id(),
        verdict,
        before,
        after,
        ratio,
        floors_ratio: b.floors().median / a.floors().median,
        noise,
        memory_ratio: memory[0].zip(memory[1]).map(|(a, b)| b / a),
    }
}

/// Three standard errors of the ratio of two medians.
fn noise(a: RoundSpread, b: RoundSpread) -> f64 {
    if a.rounds.min(b.rounds) < ROUNDS_TO_TELL {
        return UNKNOWN_NOISE;
    }
    let error = |s: RoundSpread| {
        ERROR_OF_MEDIAN * SIGMA_OF_DEVIATION * s.deviation / s.median / (s.rounds as f64).sqrt()
    };
    (ERRORS_BEYOND * error(a).hypot(error(b))).max(LEAST_NOISE)
}

fn as_text(comparison: &Comparison) -> String {
    let Comparison { before, after, same_machine, figures, only_before, only_after, ratio, noise, .. } =
        comparison;
    let mut text = format!("{}\n", summary(comparison));
    if let (Some(ratio), Some(noise)) = (ratio, noise) {
        let RoundSpread { median, min, max, .. } = noise.scaled(100.0);
        text += &format!(
            "  all together: {} times as long by the median ({} to {}); noise {median:.0} % ({min:.0} to {max:.0})\n",
            number(ratio.median),
            number(ratio.min),
            number(ratio.max),
        );
    }
    if !same_machine {
        text += "  measured on different machines: look at the ratios of floors\n";
    }
    for Compared { figure, verdict, before, after, ratio, floors_ratio, noise, memory_ratio } in figures {
        let verdict = match verdict {
            Verdict::Same => "same",
            Verdict::Slower => "SLOWER",
            Verdict::Faster => "FASTER",
            Verdict::OtherResult => "OTHER RESULT",
            Verdict::OtherInput => "OTHER INPUT",
        };
        let memory = memory_ratio.map_or(String::new(), |ratio| format!(", memory {}", number(ratio)));
        text += &format!(
            "  {verdict:12} {figure}: {} s, then {} s: {} (noise {:.0} %), floors {}{memory}\n",
            number(before.median),
            number(after.median),
            number(*ratio),
            noise * 100.0,
            number(*floors_ratio)
        );
    }
    let mut missing = |name: &str, ids: &[String]| {
        ids.iter().for_each(|id| text += &format!("  only in {name}: {id}\n"));
    };
    missing(before, only_before);
    missing(after, only_after);
    text
}

/// The verdict in a line.
fn summary(comparison: &Comparison) -> String {
    let Comparison { before, after, figures, equal, .. } = comparison;
    if *equal {
        return format!("{after} has the times of {before} within the noise, {} figures", figures.len());
    }
    let count = |verdict| figures.iter().filter(|figure| figure.verdict == verdict).count();
    let of = figures.len();
    let kinds = [
        (Verdict::Slower, "slower"),
        (Verdict::Faster, "faster"),
        (Verdict::OtherResult, "with another result"),
        (Verdict::OtherInput, "of another input"),
    ];
    let told =
        kinds.map(|(verdict, name)| (count(verdict), name)).into_iter().filter(|(count, _)| *count > 0);
    let told: Vec<String> = told.map(|(count, name)| format!("{count} {name}")).collect();
    format!("{after} differs from {before} beyond the noise: of {of} figures {}", told.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(values: &[f64]) -> RoundSpread {
        RoundSpread::of(values.iter().copied())
    }

    #[test]
    fn noise_follows_from_the_rounds() {
        let steady = spread(&[1.0, 1.0, 1.0]);
        assert_eq!(noise(steady, steady), LEAST_NOISE);
        assert_eq!(noise(steady, spread(&[1.0, 1.0])), UNKNOWN_NOISE);
        let rough = spread(&[0.9, 1.0, 1.1, 0.9, 1.1]);
        let expected = 3.0 * 1.2533 * 1.4826 * 0.1 / 5f64.sqrt() * 2f64.sqrt();
        assert!((noise(rough, rough) - expected).abs() < 1e-12);
    }
}
