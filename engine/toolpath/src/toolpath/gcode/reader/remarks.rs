//! What comments change: layers, features and regions, sizes of beads.

use super::comments::{self, Comment};
use super::machine::MachineState;
use super::regions::{self, CommentMeaning};
use super::words::{Words, behind_number};
use crate::error::Result;

/// A feature, and the width of its region.
type Mark = (Option<u16>, Option<f64>);

impl MachineState<'_, '_> {
    /// Takes in the comments in a line. Those of a move name its region; what they say of a travel is taken back
    /// with the value returned.
    pub(super) fn comments_of(&mut self, line: &[u8], alone: bool) -> Result<Option<Mark>> {
        let mut before = None;
        let moves = alone || begins_move(line);
        for (comment, in_parentheses) in regions::comments(line) {
            match regions::meaning(comment, in_parentheses) {
                Some(CommentMeaning::Deposit(name, width)) if moves => self.enter_region(name, width)?,
                Some(CommentMeaning::Travel) if moves && !alone => {
                    before = Some((self.feature, self.region_width));
                    self.enter_region(regions::TRAVEL, None)?;
                }
                Some(CommentMeaning::Layer) => self.begin_layer(),
                None if alone && in_parentheses => {
                    // Comments of slicers, put into parentheses.
                    self.comment(&[b";", comment].concat())?;
                }
                _ => {}
            }
        }
        Ok(before)
    }

    fn enter_region(&mut self, name: &str, width: Option<f64>) -> Result<()> {
        self.feature = Some(self.beads.feature(name.as_bytes(), self.line)?);
        self.region_width = match width {
            None => None,
            Some(stated) => {
                let width = regions::width(stated, self.position.unit);
                self.checked(width, "a comment's width is no size")
            }
        };
        Ok(())
    }

    pub(super) fn comment(&mut self, comment: &[u8]) -> Result<()> {
        match regions::meaning(&comment[1..], false) {
            None => {}
            Some(CommentMeaning::Layer) => self.begin_layer(),
            Some(CommentMeaning::Deposit(name, width)) => return self.enter_region(name, width),
            Some(CommentMeaning::Travel) => return Ok(()),
        }
        match comments::meaning(comment) {
            Comment::Feature(name) => self.feature = Some(self.beads.feature(name, self.line)?),
            Comment::Width(width) => self.width = self.checked(width, "a comment's width is no size"),
            Comment::Height(height) => self.height = self.checked(height, "a comment's height is no size"),
            Comment::Layer => self.begin_layer(),
            Comment::Mesh(name) => {
                let name = String::from_utf8_lossy(&name[..name.len().min(200)]);
                let meshes = &mut self.beads.report.meshes;
                if meshes.len() < 1000 && name != "NONMESH" && meshes.iter().all(|known| *known != name) {
                    meshes.push(name.into_owned());
                }
            }
            Comment::Other => {}
        }
        Ok(())
    }

    fn begin_layer(&mut self) {
        // What is deposited before the first mark belongs to the first layer.
        self.layer += u32::from(self.layer_is_marked && !self.layer_is_fresh);
        (self.layer_is_marked, self.layer_is_fresh) = (true, true);
    }

    fn checked(&mut self, size: Option<f64>, complaint: &str) -> Option<f64> {
        if size.is_none() {
            self.beads.report.note(complaint, self.line);
        }
        size
    }
}

/// Whether a line begins like one that moves the tool: with a G code or a coordinate.
fn begins_move(line: &[u8]) -> bool {
    let mut words = Words::new(line);
    let first = words.rest();
    let first = if matches!(first, [b'N' | b'n', ..]) { behind_number(first) } else { first };
    first.first().is_some_and(|letter| !matches!(letter | 0x20, b'm' | b't'))
}
