//! The journal of an unfinished store: which records of `NAME.part` are durable.
//!
//! A file of its own, `NAME.journal`, so that the finished store has no trace of where its writing was interrupted. It
//! is only ever appended to: a head, then one frame a commit, each with a checksum over what stands before it as well.
//!
//! So the frames up to the first that is damaged are the state, and nothing that was valid is ever overwritten.
//! `FORMAT.md` shows the bytes.

use super::identity::{Fields, IDENTITY_ENTRY_BYTES, IdentityEntry};
use super::layout::{ENTRY_BYTES, FILE_ID_BYTES, FileId, HEADER_BYTES, IndexEntry, META_BYTES_MAX, Version};
use super::meta::Meta;
use crate::disk::planted::{Bug, planted};
use std::path::{Path, PathBuf};

/// First bytes of every journal.
pub(super) const JOURNAL_MAGIC: [u8; 8] = *b"\x89BRJ\r\n\x1a\n";
/// The version of these bytes.
pub(super) const JOURNAL_VERSION: u32 = 1;
/// Bytes of the head before the metadata.
pub(super) const JOURNAL_HEAD_BYTES: usize = 44;
/// Bytes of a frame before its entries.
pub(super) const FRAME_BYTES: usize = 28;
/// Most bytes of the settings: a cross-section of thousands of corners is the longest there is.
pub(super) const SETTINGS_BYTES_MAX: usize = 1 << 20;

/// Most settings.
const SETTINGS_MAX: usize = 256;

/// Names and values of settings.
pub type SettingPairs = Vec<(String, String)>;

/// What an unfinished store will be.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct JournalHead {
    pub version: Version,
    /// Without what is known at the end only.
    pub meta: Meta,
    /// What decides the store beside what the metadata say.
    pub settings: SettingPairs,
}

/// A commit: records that were appended, and that are durable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct CommitFrame {
    /// 1 for the first.
    pub generation: u64,
    /// Where the records end.
    pub records_end: u64,
    /// Nodes, in the order in which they were appended.
    pub entries: Vec<IndexEntry>,
    /// Lists of beads behind them, likewise.
    pub lists: Vec<IdentityEntry>,
    /// Where the frame ends in the journal.
    pub end: u64,
    /// Its checksum, which that of the next begins with.
    pub crc: u32,
}

/// A journal's content, as far as it is sound.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Journal {
    pub head: JournalHead,
    pub frames: Vec<CommitFrame>,
    /// Where the head ends.
    pub head_end: u64,
    /// Its checksum.
    pub head_crc: u32,
}

/// The name of a store's journal.
pub(super) fn journal_path(final_path: &Path) -> PathBuf {
    let mut name = final_path.as_os_str().to_owned();
    name.push(".journal");
    PathBuf::from(name)
}

/// The name of the journal that belongs to a file `NAME.part`.
pub(super) fn journal_of_part(part: &Path) -> Option<PathBuf> {
    (part.extension()? == "part").then(|| journal_path(&part.with_extension("")))
}

impl JournalHead {
    /// The stored form and its checksum; the error is one phrase.
    pub fn encode(&self) -> Result<(Vec<u8>, u32), String> {
        let meta = self.meta.encode()?;
        let settings = encode_settings(&self.settings);
        if settings.len() > SETTINGS_BYTES_MAX || self.settings.len() > SETTINGS_MAX {
            return Err(format!("the settings take more than {SETTINGS_BYTES_MAX} bytes"));
        }
        let mut out = JOURNAL_MAGIC.to_vec();
        out.extend(JOURNAL_VERSION.to_le_bytes());
        out.extend(self.version.number().to_le_bytes());
        out.extend(self.meta.file_id());
        out.extend((meta.len() as u32).to_le_bytes());
        out.extend((settings.len() as u32).to_le_bytes());
        out.extend([0; 4]);
        debug_assert_eq!(out.len(), JOURNAL_HEAD_BYTES);
        out.extend(meta);
        out.extend(settings);
        let crc = crc32fast::hash(&out);
        out.extend(crc.to_le_bytes());
        Ok((out, crc))
    }
}

/// Pairs as texts with their lengths, as in the journal.
pub fn encode_settings(settings: &SettingPairs) -> Vec<u8> {
    let mut out = Vec::new();
    for text in settings.iter().flat_map(|(name, value)| [name, value]) {
        out.extend((text.len() as u32).to_le_bytes());
        out.extend(text.as_bytes());
    }
    out
}

/// Appends the stored form of a frame to `out` and returns its checksum. `before` is that of what stands before it.
pub(super) fn encode_frame(
    (generation, records_end): (u64, u64),
    entries: &[IndexEntry],
    lists: &[IdentityEntry],
    before: u32,
    out: &mut Vec<u8>,
) -> u32 {
    let start = out.len();
    out.extend(generation.to_le_bytes());
    out.extend(records_end.to_le_bytes());
    out.extend((entries.len() as u32).to_le_bytes());
    out.extend((lists.len() as u32).to_le_bytes());
    let crc_at = out.len();
    out.extend([0; 4]);
    entries.iter().for_each(|entry| out.extend(entry.encode()));
    lists.iter().for_each(|entry| out.extend(entry.encode()));
    let crc = frame_crc(before, &out[start..]);
    out[crc_at..crc_at + 4].copy_from_slice(&crc.to_le_bytes());
    crc
}

/// Over the checksum before and the frame without its own.
pub(super) fn frame_crc(before: u32, frame: &[u8]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&before.to_le_bytes());
    crc.update(&frame[..FRAME_BYTES - 4]);
    crc.update(&frame[FRAME_BYTES..]);
    crc.finalize()
}

impl Journal {
    /// Reads the stored form. `None` if not even its head is sound: then nothing was committed. Takes memory in
    /// proportion to `bytes`.
    pub fn decode(bytes: &[u8]) -> Option<Journal> {
        let mut fields = Fields(bytes);
        let sound = fields.take(8)? == JOURNAL_MAGIC && fields.u32()? == JOURNAL_VERSION;
        let version = Version::from_number(fields.u32()?).filter(|_| sound)?;
        let file_id: FileId = fields.take(FILE_ID_BYTES)?.try_into().ok()?;
        let (meta, settings) = (fields.u32()? as usize, fields.u32()? as usize);
        if fields.u32()? != 0 || meta > META_BYTES_MAX || settings > SETTINGS_BYTES_MAX {
            return None;
        }
        let (meta, settings) = (fields.take(meta)?, fields.take(settings)?);
        let head_crc = fields.u32()?;
        let head_end = bytes.len() - fields.0.len();
        if crc32fast::hash(&bytes[..head_end - 4]) != head_crc {
            return None;
        }
        let meta = Meta::decode(meta, version).ok().filter(|meta| meta.file_id() == file_id)?;
        let head = JournalHead { version, meta, settings: decode_settings(settings)? };
        let mut journal = Journal { head, frames: Vec::new(), head_end: head_end as u64, head_crc };
        while let Some(frame) = journal.decode_frame(&mut fields, bytes.len()) {
            journal.frames.push(frame);
        }
        Some(journal)
    }

    /// The next frame, if it is sound and follows from those before.
    fn decode_frame(&self, fields: &mut Fields<'_>, journal_bytes: usize) -> Option<CommitFrame> {
        let last = self.frames.last();
        let (before, mut position) =
            last.map_or((self.head_crc, HEADER_BYTES as u64), |frame| (frame.crc, frame.records_end));
        let start = fields.0;
        let (generation, records_end) = (fields.u64()?, fields.u64()?);
        let (entries, lists, crc) = (fields.u32()? as usize, fields.u32()? as usize, fields.u32()?);
        let entries = fields.take(entries.checked_mul(ENTRY_BYTES)?)?;
        let lists = fields.take(lists.checked_mul(IDENTITY_ENTRY_BYTES)?)?;
        let frame = &start[..start.len() - fields.0.len()];
        let follows = generation == last.map_or(0, |frame| frame.generation) + 1;
        if !follows || (frame_crc(before, frame) != crc && !planted(Bug::FrameChecksumIgnored)) {
            return None;
        }
        let entries = entries.as_chunks::<ENTRY_BYTES>().0.iter().map(|entry| IndexEntry::decode(entry).ok());
        let entries: Vec<IndexEntry> = entries.collect::<Option<_>>()?;
        let lists = lists.as_chunks::<IDENTITY_ENTRY_BYTES>().0.iter().map(IdentityEntry::decode);
        let lists: Vec<IdentityEntry> = lists.collect::<Option<_>>()?;
        // Payloads follow each other without a gap.
        let bricks = entries.iter().filter(|e| !e.head.kind.is_uniform()).map(|e| (e.offset, e.length));
        for (offset, length) in bricks.chain(lists.iter().map(|e| (e.offset, e.length))) {
            if offset != position {
                return None;
            }
            position = position.checked_add(u64::from(length))?;
        }
        let end = (journal_bytes - fields.0.len()) as u64;
        (position == records_end).then_some(CommitFrame { generation, records_end, entries, lists, end, crc })
    }
}

/// What [`encode_settings`] has made; `None` if it is something else.
pub fn decode_settings(bytes: &[u8]) -> Option<SettingPairs> {
    let mut fields = Fields(bytes);
    let mut text = || {
        let length = fields.u32()? as usize;
        String::from_utf8(fields.take(length)?.to_vec()).ok()
    };
    let mut settings = SettingPairs::new();
    // Bounded, since empty ones take more memory than bytes of the file.
    while settings.len() < SETTINGS_MAX {
        let Some(name) = text() else { break };
        settings.push((name, text()?));
    }
    fields.0.is_empty().then_some(settings)
}

#[cfg(test)]
mod tests {
    use super::super::layout::record_crc;
    use super::super::testing::{brick_at, lists, meta_of_beads, nodes};
    use super::*;
    use crate::brick::codec::encode;
    use proptest::prelude::*;
    use std::sync::LazyLock;

    fn frame_of(position: &mut u64, nodes: &[(crate::lattice::NodeKey, bool)]) -> Vec<IndexEntry> {
        let entry = |&(key, leaf)| {
            let payload = encode(&brick_at(key, leaf));
            let length = payload.bytes.len() as u32;
            let offset = if length == 0 { 0 } else { *position };
            *position += u64::from(length);
            let crc = record_crc(Version::Two, key, leaf, payload.head, &payload.bytes);
            IndexEntry { key, offset, length, crc, leaf, head: payload.head }
        };
        nodes.iter().map(entry).collect()
    }

    /// A journal of three frames, the last one of lists.
    fn journal() -> (JournalHead, Vec<u8>, Vec<usize>) {
        let settings = vec![("skipped features".to_owned(), "[\"Skirt\"]".to_owned())];
        let head = JournalHead { version: Version::Two, meta: meta_of_beads(), settings };
        let (mut bytes, mut crc) = head.encode().unwrap();
        let mut ends = vec![bytes.len()];
        let mut position = HEADER_BYTES as u64;
        for (number, nodes) in nodes().chunks(9).enumerate() {
            let entries = frame_of(&mut position, nodes);
            crc = encode_frame((number as u64 + 1, position), &entries, &[], crc, &mut bytes);
            ends.push(bytes.len());
        }
        let list = IdentityEntry { key: lists()[0].0, offset: position, length: 7, crc: 9 };
        encode_frame((3, position + 7), &[], &[list], crc, &mut bytes);
        ends.push(bytes.len());
        (head, bytes, ends)
    }

    #[test]
    fn what_is_whole_is_read_and_nothing_else() {
        let (head, bytes, ends) = journal();
        let whole = Journal::decode(&bytes).unwrap();
        assert_eq!((&whole.head, whole.head_end), (&head, ends[0] as u64));
        assert_eq!(whole.frames.iter().map(|frame| frame.end as usize).collect::<Vec<_>>(), ends[1..]);
        for cut in 0..bytes.len() {
            match Journal::decode(&bytes[..cut]) {
                None => assert!(cut < ends[0]),
                Some(journal) => {
                    let frames = ends[1..].iter().filter(|end| **end <= cut).count();
                    assert_eq!(journal.frames, whole.frames[..frames]);
                }
            }
        }
    }

    #[test]
    fn every_changed_byte_shows() {
        let (_, bytes, ends) = journal();
        let whole = Journal::decode(&bytes).unwrap();
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 1 << (at % 8);
            match Journal::decode(&changed) {
                None => assert!(at < ends[0]),
                Some(journal) => {
                    let sound = ends[1..].iter().filter(|end| **end <= at).count();
                    assert_eq!(journal.frames, whole.frames[..sound], "byte {at}");
                }
            }
        }
        // A frame in the place of another, each sound.
        let (first, second) = (&bytes[ends[0]..ends[1]], &bytes[ends[1]..ends[2]]);
        let swapped = [&bytes[..ends[0]], second, first, &bytes[ends[2]..]].concat();
        assert_eq!(Journal::decode(&swapped).unwrap().frames, []);
        let dropped = [&bytes[..ends[0]], second].concat();
        assert_eq!(Journal::decode(&dropped).unwrap().frames, []);
    }

    #[test]
    fn names() {
        assert_eq!(journal_path(Path::new("a/x.brf")), Path::new("a/x.brf.journal"));
        assert_eq!(journal_of_part(Path::new("a/x.brf.part")).unwrap(), Path::new("a/x.brf.journal"));
        assert_eq!(journal_of_part(Path::new("x.brf")), None);
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(at in any::<prop::sample::Index>(), value in any::<u64>(), bits in 0u32..64) {
            static WHOLE: LazyLock<(JournalHead, Vec<u8>, Vec<usize>)> = LazyLock::new(journal);
            let (mut bytes, ends) = (WHOLE.1.clone(), &WHOLE.2);
            let at = at.index(bytes.len() - 8);
            bytes[at..at + 8].copy_from_slice(&(value >> bits).to_le_bytes());
            // The head's checksum made to fit, so that what it protects is met.
            let crc = crc32fast::hash(&bytes[..ends[0] - 4]);
            bytes[ends[0] - 4..ends[0]].copy_from_slice(&crc.to_le_bytes());
            let _ = Journal::decode(&bytes);
        }
    }
}
