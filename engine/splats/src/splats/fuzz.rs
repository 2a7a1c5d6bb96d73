//! Files of splats of any bytes.

use crate::bsp::{ENTRY_BYTES, Entry, HEADER_BYTES, Header, crc32};
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
