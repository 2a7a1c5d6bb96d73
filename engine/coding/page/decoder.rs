//! The decoder of a page in a browser, as WebAssembly. `build.sh` compiles it; `engine/splats/page` has the result.
//!
//! The page writes a file's bytes to where [`input`] says, and reads splats from where [`output`] does.

use brickfield_coding::bsp::{
    Cell, Clip, Entry, Header, NodeCells, Splat, SplatTree, ENTRY_BYTES, HEADER_BYTES, PAIRS,
};
use std::cell::RefCell;

thread_local! {
    static STATE: RefCell<State> = RefCell::new(State { input: Vec::new(), output: Vec::new(), tree: None, loaded: Vec::new() });
}

struct State {
    input: Vec<u8>,
    output: Vec<u32>,
    tree: Option<SplatTree>,
    /// Whether each unit was taken in.
    loaded: Vec<bool>,
}

impl State {
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
