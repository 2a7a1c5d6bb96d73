//! What picks in pages of splats tell.

use crate::failure::Failure;
use crate::options::error_with_options;
use crate::output::{in_line, note};
use crate::splat_args::{PicksArg, SplatsArgs};
use crate::units::Size;
use anyhow::anyhow;
use brickfield_engine::build::{bead_sources, bounds_of_sources, listed_beads};
use brickfield_engine::ingest::{Input, OpenOptions};
use brickfield_engine::solid::Outline;
use brickfield_engine::splats::{PickBeads, viewer_bytes};
use brickfield_engine::store::{BeadsMeta, BrickTree, Store};
use brickfield_engine::{Error, ErrorKind, Progress};
use std::path::Path;

/// Beads may take one in so many of the bytes of all else in a page, or so many bytes.
const SHARE: usize = 2;
const BYTES_FREE: usize = 1 << 20;

/// What picks tell, and whether somebody asked for that.
pub(super) struct Picks {
    beads: Option<PickBeads>,
    is_asked: bool,
    /// Why there are no beads, to be told in the end.
    why: Option<String>,
}

impl Picks {
    /// The beads of a store, if picks are to tell them.
    pub fn new(args: &SplatsArgs, store: &Store, bars: &dyn Progress) -> Result<Picks, Failure> {
        let wanted = args.picks.unwrap_or_default();
        let is_asked = wanted == PicksArg::Beads;
        let mut picks = Picks { beads: None, is_asked, why: None };
        if wanted == PicksArg::Positions {
            return Ok(picks);
        }
        let name = in_line(&args.store);
        let Some(beads) = &store.meta().beads else {
            let is_toolpath = store.meta().sources.iter().any(|source| source.format.contains("G-code"));
            if is_asked || is_toolpath {
                let what =
                    "the store knows no beads as solids; build it from toolpaths, without --beads mesh";
                picks.refuse(&format!("{name}: {what}"))?;
            }
            return Ok(picks);
        };
        let memory = PickBeads::memory(store).unwrap_or_default();
        if memory > args.memory.0 {
            let needed = Size(memory);
            picks.refuse(&format!("{name}: its beads take {needed} of memory; allow more with --memory"))?;
            return Ok(picks);
        }
        if beads.identity.is_some() {
            picks.beads = PickBeads::new(store, bars)?;
            return Ok(picks);
        }
        match read_again(store, beads, bars) {
            Ok(beads) => picks.beads = Some(beads),
            Err(Unread::Interrupted(error)) => return Err(error.into()),
            Err(Unread::For(why)) => picks.refuse(&format!("{why}; build {name} with --identity"))?,
        }
        Ok(picks)
    }

    /// Those for a folder, whose page reads what a pick needs.
    pub fn beside(&self) -> Option<&PickBeads> {
        self.beads.as_ref()
    }

    /// The table for a page with these splats; empty without one.
    pub fn within(&mut self, splats: &[u8]) -> Result<Vec<u8>, Failure> {
        let Some(beads) = &self.beads else { return Ok(Vec::new()) };
        let table = beads.bytes(splats);
        let rest = splats.len() + viewer_bytes();
        if self.is_asked || table.len() <= BYTES_FREE.max(rest / SHARE) {
            return Ok(table);
        }
        let [of_beads, of_rest] = [table.len(), rest].map(|bytes| Size(bytes as u64));
        self.refuse(&format!(
            "beads would take {of_beads} beside {of_rest} of all else; --picks beads takes them along"
        ))?;
        Ok(Vec::new())
    }

    /// Notes why there are no beads, or fails if they were asked for.
    fn refuse(&mut self, why: &str) -> Result<(), Failure> {
        if self.is_asked {
            return Err(anyhow!("{why}").into());
        }
        self.why = Some(why.to_owned());
        Ok(())
    }

    /// Says why there are no beads.
    pub fn tell(&self) {
        if let Some(why) = &self.why {
            note(&format!("picks tell positions alone: {why}"));
        }
    }
}

/// Why beads were not read again.
enum Unread {
    Interrupted(Error),
    For(String),
}

/// The beads of a store that does not tell them apart, from its toolpaths, where these are what they were and give the same beads.
fn read_again(store: &Store, beads: &BeadsMeta, bars: &dyn Progress) -> Result<PickBeads, Unread> {
    let failed = |error: Error| match error.kind() {
        ErrorKind::Interrupted => Unread::Interrupted(error),
        _ => Unread::For(error_with_options(error)),
    };
    let mut inputs = Vec::new();
    for source in &store.meta().sources {
        let (path, name) = (Path::new(&source.path), in_line(Path::new(&source.path)));
        if !path.exists() {
            return Err(Unread::For(format!("{name}: the toolpath is not there any more")));
        }
        let input = Input::open_with(path, &OpenOptions::default(), bars).map_err(failed)?;
        if input.identity().map_err(failed)? != source.blake3 {
            return Err(Unread::For(format!("{name}: the toolpath has been changed")));
        }
        inputs.push(input);
    }
    let sources = bead_sources(&inputs).map_err(failed)?;
    let unlike = || {
        let name = in_line(Path::new(&store.meta().sources[0].path));
        Unread::For(format!("{name}: the toolpath was read with other options when the store was built"))
    };
    let outline = Outline::from_name(&beads.section).ok_or_else(unlike)?;
    let (tables, segments) =
        listed_beads(&sources, (outline, beads.count()), store.root()).map_err(failed)?;
    let passes = tables.passes.last().map(|passes| u64::from(*passes));
    let bounds = bounds_of_sources(&sources, outline).map_err(failed)?;
    let is_like = tables.beads.len() as u64 == beads.beads
        && passes == beads.passes
        && bounds == (store.meta().bounds_min, store.meta().bounds_max);
    if !is_like {
        return Err(unlike());
    }
    PickBeads::of(store, tables, segments, bars).map_err(failed)
}
