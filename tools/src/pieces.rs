//! How pieces are turned outward, as people type it, and what they are told of pieces that are inside out.

use crate::measured::measured;
use brickfield_engine::analysis::{negative_volume, winding_range};
use brickfield_engine::pieces::{Consistency, InsideOut, PiecesReport};
use brickfield_engine::store::Store;
use brickfield_engine::{Progress, Result};
use clap::ValueEnum;
use std::ffi::OsString;

/// What is turned over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum OrientArg {
    /// Connected pieces as a whole: outward, but for cavities
    Pieces,
    /// Single facets first, so that those of a piece face one side; then pieces
    All,
}

impl From<OrientArg> for Consistency {
    fn from(orient: OrientArg) -> Consistency {
        match orient {
            OrientArg::Pieces => Consistency::Given,
            OrientArg::All => Consistency::Sought,
        }
    }
}

/// Arguments in which the value of --orient, if one follows it, is joined to it: it may be left out, so that what follows
/// it may as well be an input.
pub fn joined(args: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut joined: Vec<OsString> = Vec::new();
    let mut is_over = false;
    for arg in args {
        let value = arg.to_str().filter(|value| ["pieces", "all"].contains(value));
        match (joined.last_mut(), value) {
            (Some(last), Some(value)) if !is_over && *last == "--orient" => {
                *last = format!("--orient={value}").into()
            }
            _ => {
                is_over |= arg == "--";
                joined.push(arg);
            }
        }
    }
    joined
}

/// Pieces that are inside out, for people.
pub fn inside_out_text(found: &InsideOut, input: &str, unit: &str) -> String {
    let InsideOut { pieces, volume, facet, .. } = found;
    match pieces {
        1 => format!(
            "1 piece is inside out, {volume:.3} {unit}³ (facet {facet} of {input} is its first); build --orient turns it"
        ),
        _ => format!(
            "{pieces} pieces are inside out, {volume:.3} {unit}³ in all (facet {facet} of {input} is the first of the \
             largest); build --orient turns them"
        ),
    }
}

/// What pieces were found, for people.
pub fn pieces_text(report: &PiecesReport) -> String {
    let PiecesReport { pieces, open, inconsistent, cavities, inside_out, .. } = report;
    let mut text = format!("{pieces}");
    let mut add = |count: u64, what: &str| {
        if count > 0 {
            text += &format!(", {count} {what}");
        }
    };
    add(inside_out.map_or(0, |found| found.pieces), "inside out");
    add(*cavities, if *cavities == 1 { "cavity" } else { "cavities" });
    add(*open, "open");
    add(*inconsistent, "with facets that face both sides");
    text
}

/// What the user should know of pieces that were to be turned and could not be.
pub fn left_text(report: &PiecesReport, asked: OrientArg) -> Vec<String> {
    let mut lines = Vec::new();
    let many = |count: u64| {
        if count == 1 { ("piece", "has", "stays as it is") } else { ("pieces", "have", "stay as they are") }
    };
    if report.open > 0 {
        let (piece, have, stay) = many(report.open);
        lines.push(format!(
            "{} {piece} {have} holes, so no side is outward, and {stay}; close them",
            report.open
        ));
    }
    if report.inconsistent > 0 {
        let (piece, have, stay) = many(report.inconsistent);
        let remedy = match asked {
            OrientArg::Pieces => "use --orient all",
            OrientArg::All => "repair them: no way of turning facets makes all face one side",
        };
        let count = report.inconsistent;
        lines.push(format!("{count} {piece} {have} facets that face both sides, and {stay}; {remedy}"));
    }
    lines
}

/// What the field of a store of closed meshes is below zero, with a bound on its error, or `None` if that is nowhere. Reads only what is negative.
///
/// # Errors
/// What reading the store gives, and if the user interrupts.
pub fn negative(store: &Store, progress: &dyn Progress) -> Result<Option<(f64, f64)>> {
    let is_negative = winding_range(store).is_some_and(|(lowest, _)| lowest < 0);
    if !is_negative || store.meta().shard.is_some() || store.is_unfinished() || store.meta().holds_points() {
        return Ok(None);
    }
    let negative = negative_volume(store, progress)?.filter(|(volume, _)| *volume > 0.0);
    // Lines through the source are nearer than samples.
    let source = store.meta().volumes.as_ref().map(|volumes| volumes.negative).filter(|n| n.value > 0.0);
    Ok(negative.map(|negative| source.map_or(negative, |source| (source.value, source.bound()))))
}

/// The line about it.
pub fn negative_text((volume, error): (f64, f64), unit: &str) -> String {
    let volume = measured(volume, error);
    format!(
        "w is negative in {volume} {unit}³: pieces of the input are inside out there; build it again with --orient"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_joined_to_its_option_only() {
        let joined = |args: &[&str]| {
            let args = joined(args.iter().map(OsString::from));
            args.into_iter().map(|arg| arg.into_string().unwrap()).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(joined(&["build", "--orient", "all", "a.stl"]), "build --orient=all a.stl");
        assert_eq!(joined(&["build", "--orient", "a.stl"]), "build --orient a.stl");
        assert_eq!(joined(&["all", "--orient"]), "all --orient");
        assert_eq!(joined(&["--orient", "pieces", "all"]), "--orient=pieces all");
        assert_eq!(joined(&["--", "--orient", "all"]), "-- --orient all");
    }
}
