//! The decoder of a page in a browser, as WebAssembly. `build.sh` compiles it; `engine/splats/page` has the result.
//!
//! The page writes a file's bytes to where [`input`] says, and reads splats from where [`output`] does, or a picture of them from
//! where [`pixels`] does.

use brickfield_coding::bsp::{Header, SplatTree, ENTRY_BYTES, HEADER_BYTES};
use brickfield_coding::draw::{
    packed_splats, seen_nodes, units_to_refine, DrawStyle, DrawView, PackedSplat, PageCanvas,
};
use std::cell::RefCell;

thread_local! {
    static STATE: RefCell<State> = RefCell::new(State::default());
}

/// Most pixels of a picture.
const PIXELS_MAX: usize = 1 << 26;
/// What is cut from here on is not cut.
const UNCUT: f64 = 1e30;

#[derive(Default)]
struct State {
    input: Vec<u8>,
    output: Vec<PackedSplat>,
    canvas: PageCanvas,
    tree: Option<SplatTree>,
    /// Of each unit.
    units: Vec<Unit>,
    /// Splats of all units that were taken in.
    splats: u64,
    /// Surveys so far, and the units that the last one found.
    surveys: u32,
    found: Vec<u32>,
}

#[derive(Clone, Copy, Default)]
struct Unit {
    /// Whether it was taken in.
    is_loaded: bool,
    /// The last survey that saw what it gave.
    seen: u32,
}

impl State {
    /// Has room for what the units known by now are.
    fn know(&mut self) {
        self.units.resize(self.tree.as_ref().map_or(0, |tree| tree.entries().len()), Unit::default());
    }

    /// Draws the output from the view in the input; nothing if it is none.
    fn draw(&mut self) -> Option<DrawView> {
        let view = view_of(&numbers(&self.input))?;
        self.canvas.draw(&self.output, &view);
        Some(view)
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
            Some(tree) if number < state.units.len() => tree,
            _ => return 0,
        };
        match tree.decode(number, &state.input) {
            Ok(cells) => {
                tree.take(number, &cells);
                let unit = &mut state.units[number];
                if !unit.is_loaded {
                    state.splats += u64::from(tree.entries()[number].splats);
                }
                *unit = Unit { is_loaded: true, seen: state.surveys };
                1
            }
            Err(_) => 0,
        }
    })
}

/// Puts the splats of the finest picture so far, or of a level, into the output: how many they are, of five words each, as
/// [`PackedSplat`] has them.
#[no_mangle]
pub extern "C" fn splats(level: u32) -> usize {
    STATE.with(|state| {
        let State { tree, output, units, .. } = &mut *state.borrow_mut();
        output.clear();
        let tree = match tree {
            Some(tree) => tree,
            None => return 0,
        };
        let has_below = |key: u64, of_level: u32| {
            if of_level < u32::from(tree.header().head) {
                return true;
            }
            tree.unit_of(key).map_or(false, |unit| units[unit].is_loaded)
        };
        packed_splats(tree, level, has_below, output);
        output.len()
    })
}

/// Where the splats are.
#[no_mangle]
pub extern "C" fn output() -> usize {
    STATE.with(|state| state.borrow().output.as_ptr() as usize)
}

/// Numbers of a view in the input, as [`view_of`] reads them.
const VIEW_NUMBERS: usize = 25;

/// Draws the splats of the output from the view in the input, of 25 numbers of eight bytes: 1 if the view is one.
#[no_mangle]
pub extern "C" fn draw() -> u32 {
    STATE.with(|state| u32::from(state.borrow_mut().draw().is_some()))
}

/// Where the pixels are: red, green, blue, 255; rows from the top.
#[no_mangle]
pub extern "C" fn pixels() -> usize {
    STATE.with(|state| state.borrow().canvas.pixels().as_ptr() as usize)
}

/// Draws the splats of the output from the view in the input, as [`draw`] does, and finds the units that refine what is seen
/// in it and larger than `limit` pixels: how many they are.
#[no_mangle]
pub extern "C" fn survey(limit: f64) -> usize {
    STATE.with(|state| {
        let state = &mut *state.borrow_mut();
        let drawn = state.draw();
        let State { output, canvas, tree, units, surveys, found, .. } = state;
        found.clear();
        if let (Some(tree), Some(view)) = (tree, drawn) {
            *surveys += 1;
            let seen = seen_nodes(output, canvas.seen());
            for (key, _) in &seen {
                // What a node shows it has from the units of all nodes above it.
                let mut above = key >> 3;
                while above > 0 {
                    if let Some(unit) = tree.unit_of(above) {
                        units[unit].seen = *surveys;
                    }
                    above >>= 3;
                }
            }
            *found = units_to_refine(tree, &seen, |unit| units[unit].is_loaded, &view, limit);
        }
        found.len()
    })
}

/// Where the numbers of the units are that the last survey found, of four bytes each, the most urgent first.
#[no_mangle]
pub extern "C" fn found() -> usize {
    STATE.with(|state| state.borrow().found.as_ptr() as usize)
}

/// Makes room for a unit where all splats of units together may be so many, by forgetting what was not seen for longest of units that
/// refine nodes of a level or deeper: how many splats it has if there is room, else 0.
#[no_mangle]
pub extern "C" fn room(number: usize, most: f64, level: u32) -> u32 {
    STATE.with(|state| {
        let State { tree, units, splats, surveys, .. } = &mut *state.borrow_mut();
        let tree = match tree {
            Some(tree) if number < units.len() => tree,
            _ => return 0,
        };
        let needed = u64::from(tree.entries()[number].splats);
        while (*splats + needed) as f64 > most {
            let is_last = |unit: usize| {
                let key = tree.entries()[unit].key;
                let is_loaded = |unit: usize| units[unit].is_loaded;
                (0..8).all(|octant| !tree.unit_of(key * 8 + octant).map_or(false, is_loaded))
            };
            let deep = |unit: &usize| 63 - tree.entries()[*unit].key.leading_zeros() >= 3 * level;
            let may_go = |unit: &usize| units[*unit].is_loaded && units[*unit].seen < *surveys && deep(unit);
            let oldest = (0..units.len()).filter(may_go).filter(|unit| is_last(*unit));
            match oldest.min_by_key(|unit| units[*unit].seen) {
                Some(unit) => {
                    tree.forget(unit);
                    units[unit].is_loaded = false;
                    *splats -= u64::from(tree.entries()[unit].splats);
                }
                None => return 0,
            }
        }
        tree.entries()[number].splats
    })
}

fn numbers(input: &[u8]) -> Vec<f64> {
    let each = input.chunks_exact(8).map(|bytes| {
        let mut eight = [0; 8];
        eight.copy_from_slice(bytes);
        f64::from_le_bytes(eight)
    });
    each.collect()
}

/// Columns, rows; origin, edge; right, up, towards; centre, pixel, distance; style, deepest level; where it is cut.
fn view_of(numbers: &[f64]) -> Option<DrawView> {
    if numbers.len() != VIEW_NUMBERS {
        return None;
    }
    let three = |at: usize| [numbers[at], numbers[at + 1], numbers[at + 2]];
    let size = [numbers[0] as usize, numbers[1] as usize];
    if size[0] < 1 || size[1] < 1 || size[0].checked_mul(size[1])? > PIXELS_MAX {
        return None;
    }
    Some(DrawView {
        size,
        origin: three(2),
        edge: numbers[5],
        axes: [three(6), three(9), three(12)],
        centre: three(15),
        pixel: numbers[18],
        distance: numbers[19],
        style: match numbers[20] as u32 {
            1 => DrawStyle::Normals,
            2 => DrawStyle::Levels,
            _ => DrawStyle::Light,
        },
        deepest: numbers[21] as u32,
        highest: if numbers[22..].iter().all(|c| *c >= UNCUT) { None } else { Some(three(22)) },
    })
}
