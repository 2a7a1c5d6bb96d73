//! Which bead is at a pick, in a browser, as WebAssembly. `build.sh` compiles it; `engine/splats/page` has the result.
//!
//! The page writes bytes of a table of beads to where [`input`] says, and reads what was found from where [`found`] does.

use brickfield_coding::picks::{PickTable, PickedBead};
use std::cell::RefCell;

/// Blocks of a table that stay in memory after a pick: 20 MiB.
const LOADED_MAX: usize = 64;

thread_local! {
    static STATE: RefCell<State> = RefCell::new(State { input: Vec::new(), table: None, found: Vec::new() });
}

struct State {
    input: Vec<u8>,
    table: Option<PickTable>,
    found: Vec<u8>,
}

/// Room for so many bytes; where it is.
#[no_mangle]
pub extern "C" fn input(bytes: usize) -> usize {
    STATE.with(|state| {
        let state = &mut *state.borrow_mut();
        state.input.clear();
        state.input.resize(bytes, 0);
        state.input.as_ptr() as usize
    })
}

/// Reads header, names and directory of a table of beads from the input: 1 if they are sound and belong to the file of splats
/// with this checksum of its header, 2 if they belong to another.
#[no_mangle]
pub extern "C" fn open(part: u32) -> u32 {
    STATE.with(|state| {
        let state = &mut *state.borrow_mut();
        state.table = PickTable::open(&state.input).ok();
        match &state.table {
            Some(table) if table.header().part == part => 1,
            Some(_) => 2,
            None => 0,
        }
    })
}

/// Where a block of the table begins, or behind the last one the table ends.
#[no_mangle]
pub extern "C" fn start(block: usize) -> f64 {
    STATE.with(|state| {
        let state = state.borrow();
        state.table.as_ref().filter(|table| block <= table.blocks().len()).map_or(-1.0, |table| table.start(block) as f64)
    })
}

/// The next block that must be read to know the bead at a place of the world; -1 if all are there.
#[no_mangle]
pub extern "C" fn wanted(x: f64, y: f64, z: f64, reach: f64) -> i32 {
    STATE.with(|state| {
        let state = state.borrow();
        let wanted = state.table.as_ref().and_then(|table| table.wanted([x, y, z], reach));
        wanted.map_or(-1, |block| block as i32)
    })
}

/// Reads a block from the input: 1 if it is sound.
#[no_mangle]
pub extern "C" fn block(number: usize) -> u32 {
    STATE.with(|state| {
        let state = &mut *state.borrow_mut();
        let table = state.table.as_mut();
        u32::from(table.map_or(false, |table| table.take(number, &state.input).is_ok()))
    })
}

/// Puts what is known of the bead at a place of the world where [`found`] says: so many bytes, 0 if there is none.
///
/// These are ten f64: bead and layer from 0, first and last line, lower and upper height, distance, step of heights, bytes of the
/// feature's name and of the file's, 0 of the only one; then both names.
#[no_mangle]
pub extern "C" fn nearest(x: f64, y: f64, z: f64, reach: f64) -> usize {
    STATE.with(|state| {
        let State { table, found, .. } = &mut *state.borrow_mut();
        found.clear();
        if let Some(table) = table {
            if let Some(bead) = table.nearest([x, y, z], reach) {
                tell(found, table, &bead);
            }
            if table.loaded().len() > LOADED_MAX {
                table.forget();
            }
        }
        found.len()
    })
}

/// Where what was found is.
#[no_mangle]
pub extern "C" fn found() -> usize {
    STATE.with(|state| state.borrow().found.as_ptr() as usize)
}

fn tell(found: &mut Vec<u8>, table: &PickTable, picked: &PickedBead) {
    let PickedBead { segment, distance, heights } = picked;
    let bead = segment.bead;
    let feature = &table.features()[bead.feature as usize];
    let source = if table.sources().len() > 1 { &table.sources()[bead.source as usize] } else { "" };
    let lines = if table.header().by_segment { (segment.line, segment.line) } else { bead.lines };
    let numbers = [
        f64::from(bead.number),
        f64::from(bead.layer),
        lines.0 as f64,
        lines.1 as f64,
        heights.0,
        heights.1,
        *distance,
        table.header().steps.up,
        feature.len() as f64,
        source.len() as f64,
    ];
    numbers.iter().for_each(|number| found.extend_from_slice(&number.to_le_bytes()));
    found.extend_from_slice(feature.as_bytes());
    found.extend_from_slice(source.as_bytes());
}
