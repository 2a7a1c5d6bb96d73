//! The decoder of a page in a browser, as WebAssembly. `build.sh` compiles it; `engine/splats/page` has the result.
//!
//! The page writes a file's bytes to where [`input`] says, and reads splats from where [`output`] does.

use brickfield_coding::bsp::{
    Cell, Clip, Entry, Header, NodeCells, Splat, SplatTree, ENTRY_BYTES, HEADER_BYTES, PAIRS,
};
use brickfield_coding::picks::{PickTable, PickedBead};
use std::cell::RefCell;

/// Blocks of a table of beads that stay in memory after a pick: 20 MiB.
const PICKS_LOADED_MAX: usize = 64;

thread_local! {
    static STATE: RefCell<State> = RefCell::new(State::new());
}

struct State {
    input: Vec<u8>,
    output: Vec<u32>,
    tree: Option<SplatTree>,
    /// Whether each unit was taken in.
    loaded: Vec<bool>,
    picks: Option<PickTable>,
    found: Vec<u8>,
}

impl State {
    fn new() -> State {
        State {
            input: Vec::new(),
            output: Vec::new(),
            tree: None,
            loaded: Vec::new(),
            picks: None,
            found: Vec::new(),
        }
    }

    /// Has room for what the units known by now are.
    fn know(&mut self) {
        self.loaded.resize(self.tree.as_ref().map_or(0, |tree| tree.entries().len()), false);
    }
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

/// Reads header, some entries of the directory and the head from the input: 1 if they are sound.
#[no_mangle]
pub extern "C" fn open(entries: usize) -> u32 {
    STATE.with(|state| {
        let state = &mut *state.borrow_mut();
        state.tree = opened(&state.input, entries);
        state.know();
        u32::from(state.tree.is_some())
    })
}

fn opened(input: &[u8], entries: usize) -> Option<SplatTree> {
    let header = Header::read(input).ok()?;
    let head = HEADER_BYTES.checked_add(entries.checked_mul(ENTRY_BYTES)?)?;
    let directory = input.get(HEADER_BYTES..head)?;
    SplatTree::open_part(header, directory, &input[head..]).ok()
}

/// Reads the next entries of the directory from the input: 1 if they are sound.
#[no_mangle]
pub extern "C" fn entries() -> u32 {
    STATE.with(|state| {
        let state = &mut *state.borrow_mut();
        let is_sound = state.tree.as_mut().map_or(false, |tree| tree.add_entries(&state.input).is_ok());
        state.know();
        u32::from(is_sound)
    })
}

/// Reads a unit from the input: 1 if it is sound.
#[no_mangle]
pub extern "C" fn unit(number: usize) -> u32 {
    STATE.with(|state| {
        let state = &mut *state.borrow_mut();
        let tree = match &mut state.tree {
            Some(tree) if number < state.loaded.len() => tree,
            _ => return 0,
        };
        match tree.decode(number, &state.input) {
            Ok(cells) => {
                tree.take(number, &cells);
                state.loaded[number] = true;
                1
            }
            Err(_) => 0,
        }
    })
}

/// Puts the splats of the finest picture so far, or of a level, into the output: how many they are, of five numbers each.
///
/// These are: x and y of the cell; z, level and which cuts are of edges that go in; normal and offset; those of up to two
/// splats that cut it, or 0.
#[no_mangle]
pub extern "C" fn splats(level: u32) -> usize {
    STATE.with(|state| {
        let State { tree, output, loaded, .. } = &mut *state.borrow_mut();
        output.clear();
        let tree = match tree {
            Some(tree) => tree,
            None => return 0,
        };
        let has_below = |key: u64, of_level: u32| {
            if of_level < u32::from(tree.header().head) {
                return true;
            }
            let found = tree.entries().binary_search_by_key(&key, |entry: &Entry| entry.key);
            found.map_or(false, |unit| loaded[unit])
        };
        for (&key, piece) in tree.pieces() {
            let of_level = (63 - key.leading_zeros()) / 3;
            if of_level > level {
                break;
            }
            let is_last = of_level == level || !has_below(key, of_level);
            for cell in piece.cells.iter().filter(|cell| is_last || !cell.divided) {
                put(output, key, of_level, piece, cell);
            }
        }
        output.len() / 5
    })
}

/// Where the splats are.
#[no_mangle]
pub extern "C" fn output() -> usize {
    STATE.with(|state| state.borrow().output.as_ptr() as usize)
}

fn put(output: &mut Vec<u32>, key: u64, level: u32, piece: &NodeCells<Splat>, cell: &Cell) {
    let mut at = cell.at.map(u32::from);
    for bit in 0..level {
        for (axis, place) in at.iter_mut().enumerate() {
            *place += ((key >> (3 * bit) >> axis & 1) as u32) << (5 + bit);
        }
    }
    let splats = piece.of(cell);
    for n in 0..splats.len() {
        let (mut cuts, mut count, mut inward) = ([0; 2], 0, 0);
        for (pair, ends) in PAIRS.iter().enumerate().filter(|(_, ends)| ends[1] < splats.len()) {
            let other = match ends {
                [a, b] if *a == n => *b,
                [a, b] if *b == n => *a,
                _ => continue,
            };
            let clip = cell.clip(pair);
            if clip != Clip::None && count < 2 {
                cuts[count] = packed(&splats[other]);
                inward |= u32::from(clip == Clip::Concave) << count;
                count += 1;
            }
        }
        output.extend_from_slice(&[
            at[0] & 0xffff | at[1] << 16,
            at[2] & 0xffff | level << 16 | inward << 24,
            packed(&splats[n]),
            cuts[0],
            cuts[1],
        ]);
    }
}

fn packed(splat: &Splat) -> u32 {
    let [x, y, z] = splat.normal.map(|c| u32::from(c as u8));
    x | y << 8 | z << 16 | u32::from(splat.offset as u8) << 24
}

/// Reads header, names and directory of a table of beads from the input: 1 if they are sound and belong to the file of splats
/// with this checksum of its header, 2 if they belong to another.
#[no_mangle]
pub extern "C" fn picks_open(part: u32) -> u32 {
    STATE.with(|state| {
        let state = &mut *state.borrow_mut();
        state.picks = PickTable::open(&state.input).ok();
        match &state.picks {
            Some(picks) if picks.header().part == part => 1,
            Some(_) => 2,
            None => 0,
        }
    })
}

/// Where a block of the table begins, or behind the last one the table ends.
#[no_mangle]
pub extern "C" fn picks_start(block: usize) -> f64 {
    STATE.with(|state| {
        let state = state.borrow();
        state.picks.as_ref().filter(|picks| block <= picks.blocks().len()).map_or(-1.0, |picks| picks.start(block) as f64)
    })
}

/// The next block that must be read to know the bead at a place of the world; -1 if all are there.
#[no_mangle]
pub extern "C" fn picks_wanted(x: f64, y: f64, z: f64, reach: f64) -> i32 {
    STATE.with(|state| {
        let state = state.borrow();
        let wanted = state.picks.as_ref().and_then(|picks| picks.wanted([x, y, z], reach));
        wanted.map_or(-1, |block| block as i32)
    })
}

/// Reads a block from the input: 1 if it is sound.
#[no_mangle]
pub extern "C" fn picks_block(number: usize) -> u32 {
    STATE.with(|state| {
        let state = &mut *state.borrow_mut();
        let picks = state.picks.as_mut();
        u32::from(picks.map_or(false, |picks| picks.take(number, &state.input).is_ok()))
    })
}

/// Puts what is known of the bead at a place of the world where [`picks_found`] says: so many bytes, 0 if there is none.
///
/// These are ten f64: bead and layer from 0, first and last line, lower and upper height, distance, step of heights, bytes of the
/// feature's name and of the file's, 0 of the only one; then both names.
#[no_mangle]
pub extern "C" fn picks_nearest(x: f64, y: f64, z: f64, reach: f64) -> usize {
    STATE.with(|state| {
        let State { picks, found, .. } = &mut *state.borrow_mut();
        found.clear();
        if let Some(picks) = picks {
            if let Some(bead) = picks.nearest([x, y, z], reach) {
                tell(found, picks, &bead);
            }
            if picks.loaded().len() > PICKS_LOADED_MAX {
                picks.forget();
            }
        }
        found.len()
    })
}

/// Where what was found is.
#[no_mangle]
pub extern "C" fn picks_found() -> usize {
    STATE.with(|state| state.borrow().found.as_ptr() as usize)
}

fn tell(found: &mut Vec<u8>, picks: &PickTable, picked: &PickedBead) {
    let PickedBead { segment, distance, heights } = picked;
    let bead = segment.bead;
    let feature = &picks.features()[bead.feature as usize];
    let source = if picks.sources().len() > 1 { &picks.sources()[bead.source as usize] } else { "" };
    let lines = if picks.header().by_segment { (segment.line, segment.line) } else { bead.lines };
    let numbers = [
        f64::from(bead.number),
        f64::from(bead.layer),
        lines.0 as f64,
        lines.1 as f64,
        heights.0,
        heights.1,
        *distance,
        picks.header().steps.up,
        feature.len() as f64,
        source.len() as f64,
    ];
    numbers.iter().for_each(|number| found.extend_from_slice(&number.to_le_bytes()));
    found.extend_from_slice(feature.as_bytes());
    found.extend_from_slice(source.as_bytes());
}
