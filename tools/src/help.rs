//! The order in which `--help` tells things: what a command does, examples, usage, options by task, details.
//!
//! Where commands are declared, examples stand at the end of `after_help`, as manual pages have them.

use crate::args::Cli;
use clap::{Command, CommandFactory};

/// Examples before the usage.
const TEMPLATE: &str = "{about-with-newline}\n{before-help}{usage-heading} {usage}\n\n{all-args}{after-help}";
/// The program's: commands by task instead of a list of them.
const TOP_TEMPLATE: &str =
    "{about-with-newline}\n{before-help}{usage-heading} {usage}\n\nOptions:\n{options}{after-help}";

/// Commands by task; any that is not here comes last.
const TASKS: [(&str, &[&str]); 5] = [
    ("Make stores", &["build", "csg", "machine", "offset", "cache", "verify"]),
    ("Write meshes, arrays and splats", &["mesh", "beads", "export", "splats"]),
    (
        "Ask for numbers",
        &["info", "sample", "winding", "voids", "layers", "overlap", "thickness", "deviation"],
    ),
    ("See", &["slice", "render", "view"]),
    ("The program itself", &["completions", "man", "help"]),
];

/// Options by task, in the order in which tasks are shown; what is not here stays under "Options".
const HEADINGS: [(&str, &[&str]); 7] = [
    (
        "Input",
        &[
            "unit",
            "beads_as",
            "count",
            "orient",
            "estimate_normals",
            "gwn_error",
            "points",
            "brute",
            "weld",
            "io",
            "volume",
        ],
    ),
    (
        "Cells",
        &[
            "depth",
            "cell",
            "like",
            "max_depth",
            "thin",
            "stddev",
            "boundary_error",
            "refine",
            "level",
            "outside_level",
            "error",
        ],
    ),
    ("Surface", &["iso", "tolerance", "intersection_free", "method", "follow_creases", "normals", "check"]),
    (
        "Picture",
        &[
            "x",
            "y",
            "z",
            "layer",
            "toolpath_file",
            "all",
            "pitch",
            "pixel",
            "side",
            "samples",
            "merge_tolerance",
            "no_legend",
            "preview",
            "turntable",
            "style",
            "view",
            "focus",
            "perspective",
            "cut",
            "within",
            "size",
            "supersample",
            "background",
            "lod",
            "layer_height",
            "script",
        ],
    ),
    (
        "Output",
        &[
            "output",
            "mesh",
            "origin",
            "labels",
            "regions",
            "format",
            "dtype",
            "compression",
            "identity",
            "keep_counts",
            "in_place",
            "json",
            "quiet",
            "progress",
        ],
    ),
    (
        "Threads, memory, devices",
        &["threads", "memory", "temp_dir", "backend", "device", "device_check", "gpu_memory", "devices"],
    ),
    ("Interruption and shards", &["commit_every", "restart", "shard", "plan"]),
];

/// The command line with its help in order.
pub fn command() -> Command {
    let command = arranged(Cli::command());
    let examples = command.get_before_help().map(ToString::to_string).unwrap_or_default();
    let tasks = by_task(&command);
    command.before_help(format!("{examples}\n\n{tasks}")).help_template(TOP_TEMPLATE)
}

/// A command and all below it.
fn arranged(command: Command) -> Command {
    let names: Vec<String> = command.get_subcommands().map(|sub| sub.get_name().to_owned()).collect();
    let command = names.into_iter().fold(command, |command, name| command.mut_subcommand(name, arranged));
    let command = command.mut_args(|arg| {
        let heading = HEADINGS.iter().find(|(_, ids)| ids.contains(&arg.get_id().as_str()));
        match heading {
            Some((heading, _)) if !arg.is_positional() => arg.help_heading(*heading),
            _ => arg,
        }
    });
    let text = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let (details, examples) = divided(&text);
    command.help_template(TEMPLATE).before_help(examples.to_owned()).after_help(details.to_owned())
}

/// What is told at the end, and the examples behind it.
fn divided(text: &str) -> (&str, &str) {
    let begin =
        ["Examples:\n", "Example:\n"].iter().find_map(|heading| text.find(heading)).unwrap_or(text.len());
    (text[..begin].trim_end(), &text[begin..])
}

/// All commands, by task, a line each.
fn by_task(command: &Command) -> String {
    let line = |name: &str, about: String| format!("  {name:<12} {about}\n");
    let about = |name: &str| match command.find_subcommand(name) {
        Some(sub) => sub.get_about().map(ToString::to_string),
        // Made by clap when it parses.
        None => (name == "help").then(|| "Print this, or the help of a command".to_owned()),
    };
    let mut groups = Vec::new();
    for (task, names) in TASKS {
        let lines: String = names.iter().filter_map(|name| Some(line(name, about(name)?))).collect();
        groups.push(format!("{task}:\n{lines}"));
    }
    let is_listed = |name: &str| TASKS.iter().any(|(_, names)| names.contains(&name));
    let others = command.get_subcommands().map(Command::get_name).filter(|name| !is_listed(name));
    let others: String = others.filter_map(|name| Some(line(name, about(name)?))).collect();
    if !others.is_empty() {
        groups.push(format!("Others:\n{others}"));
    }
    groups.join("\n").trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Commands that do something, with the words that are typed for them.
    fn all(command: &Command, words: &str) -> Vec<(String, Command)> {
        let below = command.get_subcommands().filter(|sub| sub.get_name() != "help");
        let below = below.flat_map(|sub| all(sub, &format!("{words} {}", sub.get_name())));
        std::iter::once((words.to_owned(), command.clone())).chain(below).collect()
    }

    #[test]
    fn every_command_has_examples_of_itself() {
        for (words, command) in all(&command(), "brickfield") {
            let examples = command.get_before_help().map(ToString::to_string).unwrap_or_default();
            assert!(examples.starts_with("Example") && examples.contains(&words), "{words}: {examples}");
            let details = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(!details.contains("Example"), "{words}");
        }
    }

    #[test]
    fn options_stand_by_task_and_names_in_the_table_are_names_of_options() {
        let all = all(&command(), "brickfield");
        for (heading, ids) in HEADINGS {
            for id in ids {
                let under = |command: &Command| {
                    command
                        .get_arguments()
                        .any(|arg| arg.get_id() == id && arg.get_help_heading() == Some(heading))
                };
                assert!(all.iter().any(|(_, command)| under(command)), "{id}");
            }
        }
        for (_, names) in TASKS {
            assert!(names.iter().all(|name| *name == "help" || all[0].1.find_subcommand(name).is_some()));
        }
    }
}
