//! The stages of contouring put together: the only file that knows all of them.

use super::adaptive::{self, MeetingSearch};
use super::field::{LevelSet, LevelSetStages};
use super::options::ContourOptions;
use super::surface::IsoLevel;
use super::{cells, faces};
use crate::error::Result;
use crate::progress::Progress;
use crate::store::BrickTree;

/// A level set of a tree with all stages.
///
/// # Errors
/// If the tree contradicts itself.
pub(super) fn field<'a>(
    tree: &'a dyn BrickTree,
    level: IsoLevel,
    options: &ContourOptions,
) -> Result<LevelSet<'a>> {
    let makers = LevelSetStages {
        cells: cells::build,
        faces: faces::find,
        draft: adaptive::draft,
        merged: adaptive::merged_vertices,
    };
    LevelSet::new(tree, level, options, makers)
}

/// With a tolerance, finds out what is merged across the borders of leaves, before anyone asks for vertices.
/// Their normals are kept where they are wanted.
///
/// # Errors
/// What reading the tree gives; if the user interrupts.
pub(super) fn merge_across(field: &mut LevelSet, normals: bool, progress: &dyn Progress) -> Result<()> {
    let Some((tolerance, intersection_free)) = field.merging() else { return Ok(()) };
    let across = adaptive::find_across(field, tolerance, normals, progress)?;
    let mut search = MeetingSearch::new(field, &across, intersection_free);
    field.put_across(across);
    loop {
        let taken = search.next(field, progress)?;
        let mut across = field.take_across();
        if taken.is_empty() {
            across.finish();
            across.sharing().into_iter().for_each(|leaf| field.forget(leaf));
            field.put_across(across);
            return Ok(());
        }
        let changed = across.give_up((&field.leaves, field.root), &taken);
        field.put_across(across);
        search.ask_again(field, &taken, &changed)?;
    }
}
