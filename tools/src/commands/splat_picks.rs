//! What picks in pages of splats tell.

use crate::failure::Failure;
use crate::output::{in_line, note};
use crate::splat_args::{PicksArg, SplatsArgs};
use crate::units::Size;
use anyhow::anyhow;
use brickfield_engine::Progress;
use brickfield_engine::splats::PickBeads;
use brickfield_engine::store::Store;

/// Of the bytes of splats in a page, those of beads may be one in so many.
const SHARE: usize = 2;

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
        let Some(memory) = PickBeads::memory(store) else {
            let is_toolpath = store.meta().sources.iter().any(|source| source.format.contains("G-code"));
            if is_asked || store.meta().beads.is_some() || is_toolpath {
                let name = in_line(&args.store);
                picks.refuse(&format!(
                    "{name}: the store does not tell beads apart; build it from toolpaths with --identity"
                ))?;
            }
            return Ok(picks);
        };
        if memory > args.memory.0 {
            let (name, needed) = (in_line(&args.store), Size(memory));
            picks.refuse(&format!("{name}: its beads take {needed} of memory; allow more with --memory"))?;
            return Ok(picks);
        }
        picks.beads = PickBeads::new(store, bars)?;
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
        if self.is_asked || table.len() <= splats.len() / SHARE {
            return Ok(table);
        }
        let [of_beads, of_splats] = [table.len(), splats.len()].map(|bytes| Size(bytes as u64));
        self.refuse(&format!(
            "beads would take {of_beads} beside {of_splats} of splats; --picks beads takes them along"
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
