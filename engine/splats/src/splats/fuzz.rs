//! Files of splats, and tables of beads, of any bytes.

use crate::bsp::{ENTRY_BYTES, Entry, HEADER_BYTES, Header, crc32};
use crate::picks::{PICK_BLOCK_BYTES, PICK_HEADER_BYTES, PickBlock, PickHeader, PickTable};
use crate::progress::Silent;

/// A file as it is, and with checksums that fit, without which hardly any change would reach what is behind them.
pub fn bsp(bytes: &[u8]) {
    read(bytes);
    if let Some(sealed) = sealed(bytes) {
        read(&sealed);
    }
}

fn read(bytes: &[u8]) {
    match super::read_tree(bytes, None, &Silent).expect("nobody interrupts") {
        Ok(tree) => super::discs_of_tree(&tree, None, |disc| assert!(disc.cell > 0.0)),
        Err(fault) => assert!(!fault.0.contains('\n')),
    }
}

/// The same bytes with checksums that fit, if there is a header to put them in.
pub fn sealed(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut sealed = bytes.to_vec();
    // The header's own first, so that it can be read.
    let end = HEADER_BYTES - 4;
    let crc = crc32(0, sealed.get(..end)?);
    sealed.get_mut(end..HEADER_BYTES)?.copy_from_slice(&crc.to_le_bytes());
    let mut header = Header::read(&sealed).ok()?;
    let (directory, units) = (header.head_start(), header.units_start());
    if sealed.len() < units {
        return None;
    }
    let mut start = units;
    for at in (HEADER_BYTES..directory).step_by(ENTRY_BYTES) {
        let mut entry = Entry::read(&sealed[at..]);
        let end = (start + entry.bytes as usize).min(sealed.len());
        entry.crc = Entry::crc_of(entry.key, &sealed[start..end]);
        sealed[at..at + ENTRY_BYTES].copy_from_slice(&entry.to_bytes());
        start = end;
    }
    header.directory_crc = crc32(0, &sealed[HEADER_BYTES..directory]);
    header.head_crc = crc32(0, &sealed[directory..units]);
    sealed[..HEADER_BYTES].copy_from_slice(&header.to_bytes());
    Some(sealed)
}

/// A table of beads as it is, and with checksums that fit.
pub fn picks(bytes: &[u8]) {
    ask(bytes);
    if let Some(sealed) = sealed_picks(bytes) {
        ask(&sealed);
    }
}

/// Reads each block that is there, and asks for beads at and beside what is in it.
fn ask(bytes: &[u8]) {
    let mut table = match PickTable::open(bytes) {
        Ok(table) => table,
        Err(fault) => return assert!(!fault.0.contains('\n')),
    };
    for block in 0..table.blocks().len() {
        let [from, to] = [block, block + 1].map(|n| table.start(n));
        let there = usize::try_from(from).ok().zip(usize::try_from(to).ok());
        let Some(coded) = there.and_then(|(from, to)| bytes.get(from..to)) else { return };
        if let Err(fault) = table.take(block, coded) {
            return assert!(!fault.0.contains('\n'));
        }
        let (origin, steps) = (table.header().origin, table.header().steps);
        let first = table.loaded()[&block][0].a.map(f64::from);
        let scale = [steps.across, steps.across, steps.up];
        let place: [f64; 3] = std::array::from_fn(|a| origin[a] + first[a] * scale[a]);
        let found = table.nearest(place, 10.0 * steps.across);
        assert!(found.is_none_or(|found| !found.distance.is_nan()));
        let _ = table.wanted(place.map(|c| c + steps.up), f64::INFINITY);
        // As a page does, so that memory has a bound.
        if table.loaded().len() > 8 {
            table.forget();
        }
    }
}

/// The same bytes with checksums that fit, if there is a header to put them in.
fn sealed_picks(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut sealed = bytes.to_vec();
    let end = PICK_HEADER_BYTES - 4;
    let crc = crc32(0, sealed.get(..end)?);
    sealed.get_mut(end..PICK_HEADER_BYTES)?.copy_from_slice(&crc.to_le_bytes());
    let mut header = PickHeader::read(&sealed).ok()?;
    let [directory, blocks] = [header.directory_start(), header.blocks_start()].map(|at| at as usize);
    if sealed.len() < blocks {
        return None;
    }
    let mut start = blocks;
    for at in (directory..blocks).step_by(PICK_BLOCK_BYTES) {
        let mut entry = PickBlock::read(&sealed[at..]);
        let end = (start + entry.bytes as usize).min(sealed.len());
        entry.crc = crc32(0, &sealed[start..end]);
        sealed[at..at + PICK_BLOCK_BYTES].copy_from_slice(&entry.to_bytes());
        start = end;
    }
    header.crc = crc32(0, &sealed[PICK_HEADER_BYTES..blocks]);
    sealed[..PICK_HEADER_BYTES].copy_from_slice(&header.to_bytes());
    Some(sealed)
}
