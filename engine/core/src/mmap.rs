//! Read-only maps of whole files, and maps of temporary ones: the one place beside `gpu` that needs `unsafe`.
//!
//! A map lets files larger than memory be read by many threads without a copy: reading a gigabyte from the page cache
//! takes 20 ms of processor time, copying it out by positioned reads 60 to 100 ms. What a map cannot promise: that nobody
//! else changes the file meanwhile.
//!
//! If another process *cuts the file short*, or the disk or the network below fails, touching a page that is lost raises
//! SIGBUS. The first map installs a handler for that signal, for the whole process. If the address lies in one of these
//! maps, it puts zeros in the place of all from that page on and notes it in the map; [`MappedFile::check`] then
//! says so. Any other SIGBUS is left to the handler that was there before, as if this one were not. So what has been read
//! from a map counts only when `check` has passed *after* it was read.
//!
//! If another process *rewrites* the file in place, or appends to it, the bytes seen change under the reader. `check` finds
//! that by size and time of the last change; what is cut off within the last page, which reads as zeros without a
//! signal, too. A file that is *replaced*, as programs do that write under another name and rename, stays what it was for
//! whoever has it open.
//!
//! Stores are read by positioned reads unless a map is asked for (`store::Io`). Everything that is to last goes through
//! positioned writes, never through a map. What does not fit in memory may be in a map of a temporary file
//! ([`TemporaryMap`]); the system writes its pages out and drops them where memory is short.

use crate::error::{Error, Result};
use std::ffi::{c_int, c_void};
use std::fs::{File, Metadata};
use std::io::Read;
use std::mem::MaybeUninit;
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering, fence};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, SystemTime};

/// Difference of two times of change that may be the same one: network file systems round what their client has seen to
/// what their server keeps, by up to two seconds.
const SAME_TIME: Duration = Duration::from_secs(2);

/// How the bytes of a map will be touched; a hint for the system's read-ahead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// From front to back: read far ahead.
    Sequential,
    /// Here and there: read nothing ahead.
    Random,
}

/// A whole file, mapped read-only. `Send` and `Sync`; the map lives as long as the value.
#[derive(Debug)]
pub struct MappedFile {
    path: PathBuf,
    /// What the file was when it was opened.
    opened: Identity,
    /// `None` for an empty file: the system refuses maps of length 0.
    map: Option<GuardedMap>,
}

/// What tells a file, and whether it has changed.
#[derive(Clone, Copy, Debug)]
struct Identity {
    place: (u64, u64),
    bytes: u64,
    changed: Option<SystemTime>,
}

impl Identity {
    fn of(metadata: &Metadata) -> Identity {
        let place = (metadata.dev(), metadata.ino());
        Identity { place, bytes: metadata.len(), changed: metadata.modified().ok() }
    }

    /// Whether this is the same file with, as far as can be told, another content.
    fn has_become(self, now: Identity) -> bool {
        let apart = |a: SystemTime, b: SystemTime| a.duration_since(b).or_else(|_| b.duration_since(a));
        let touched = match (self.changed, now.changed) {
            (Some(a), Some(b)) => apart(a, b).is_ok_and(|time| time > SAME_TIME),
            _ => false,
        };
        self.place == now.place && (self.bytes != now.bytes || touched)
    }
}

impl MappedFile {
    /// Maps the regular file `path`. Allocates nothing that depends on the file's size.
    ///
    /// # Errors
    /// If it does not exist, may not be read, is a directory, pipe or device, or the system refuses the map.
    pub fn open(path: &Path) -> Result<MappedFile> {
        let (file, bytes) = open_regular(path)?;
        let opened = Identity::of(&file.metadata().map_err(Error::io(path, "read the size"))?);
        let path_buf = path.to_owned();
        if bytes == 0 {
            return Ok(MappedFile { path: path_buf, opened, map: None });
        }
        install_handler().map_err(Error::io(path, "map"))?;
        // SAFETY: the map is private to this value, read-only, and handed out only as `&[u8]`, for which every
        // byte pattern is valid. What the language cannot exclude is that another process changes the file;
        // no code of this library keeps a reference into the map across which it relies on a byte staying
        // equal for memory safety (lengths and indices taken from it are checked after they were copied out).
        // A page that is lost becomes zeros, see `on_lost_page`.
        let map = unsafe { memmap2::Mmap::map(&file) }.map_err(Error::io(path, "map"))?;
        Ok(MappedFile { path: path_buf, opened, map: Some(GuardedMap { slot: Slot::take(&map), map }) })
    }

    /// The content. Zeros in the place of what has been lost, see [`Self::check`].
    #[inline]
    pub fn bytes(&self) -> &[u8] {
        self.map.as_ref().map_or(&[], |guarded| &guarded.map)
    }

    /// Length in bytes.
    pub fn len(&self) -> u64 {
        self.bytes().len() as u64
    }

    /// True if the file has no bytes.
    pub fn is_empty(&self) -> bool {
        self.map.is_none()
    }

    /// The first byte that was asked for and could not be had, or one of its page before it; zeros stand there and behind.
    pub fn lost(&self) -> Option<u64> {
        let guarded = self.map.as_ref()?;
        let lost = guarded.slot.lost.load(Ordering::Acquire);
        (lost != NONE).then(|| lost.saturating_sub(guarded.map.as_ptr() as usize) as u64)
    }

    /// Whether what was read so far is what the file held when it was opened.
    ///
    /// # Errors
    /// [`Error::Input`] if a part of it was lost, or if the file has been changed.
    pub fn check(&self) -> Result<()> {
        let remedy = "leave the file alone until it has been read, and try again";
        if let Some(byte) = self.lost() {
            let what = "cannot be read any more: the file has been cut short, or its disk has failed";
            return Err(Error::input(&self.path, format!("byte {byte}"), what, remedy));
        }
        // A file that is gone, or another one of its name, says nothing of the one that is open.
        let Ok(now) = std::fs::metadata(&self.path) else { return Ok(()) };
        let now = Identity::of(&now);
        if !self.opened.has_become(now) {
            return Ok(());
        }
        let what =
            format!("has been changed since it was opened ({} bytes, now {})", self.opened.bytes, now.bytes);
        Err(Error::input(&self.path, "content", what, remedy))
    }

    /// Tells the system how the bytes will be read. Only a hint: a refusal, and a system without such hints,
    /// cost speed at most, so nothing is reported.
    pub fn advise(&self, access: Access) {
        if let Some(GuardedMap { map, .. }) = &self.map {
            let advice = match access {
                Access::Sequential => memmap2::Advice::Sequential,
                Access::Random => memmap2::Advice::Random,
            };
            map.advise(advice).ok();
        }
    }

    /// Tells the system that a part will be read before long; a hint, as [`Self::advise`].
    pub fn advise_ahead(&self, offset: u64, bytes: u64) {
        let inside = offset.checked_add(bytes).is_some_and(|end| end <= self.len());
        if let Some(GuardedMap { map, .. }) = self.map.as_ref().filter(|_| inside) {
            map.advise_range(memmap2::Advice::WillNeed, offset as usize, bytes as usize).ok();
        }
    }
}

/// A temporary file without a name, as bytes that can be changed. It grows, and holds zeros where nothing was written.
///
/// Its blocks are there before its bytes are, so that a full disk is an error and no signal. If the disk fails later, the
/// signal ends the program, which is better than zeros in the place of what was written.
#[derive(Debug)]
pub struct TemporaryMap {
    folder: PathBuf,
    file: File,
    map: Option<memmap2::MmapMut>,
}

impl TemporaryMap {
    /// An empty file in a folder.
    ///
    /// # Errors
    /// If none can be made there.
    pub fn new(folder: &Path) -> Result<TemporaryMap> {
        let file = tempfile::tempfile_in(folder).map_err(Error::io(folder, "create a temporary file in"))?;
        Ok(TemporaryMap { folder: folder.to_owned(), file, map: None })
    }

    /// Makes it as long as this; it never becomes shorter.
    ///
    /// # Errors
    /// If the disk has not so much room, or the system refuses the map.
    pub fn grow(&mut self, bytes: u64) -> Result<()> {
        let before = self.bytes().len() as u64;
        if bytes <= before {
            return Ok(());
        }
        self.allocate(before, bytes).map_err(Error::io(&self.folder, "write a temporary file in"))?;
        self.map = None;
        // SAFETY: the file has no name and this value alone has it open, so nobody else changes it or cuts it short; its
        // blocks are allocated. The bytes are handed out as `&[u8]` and `&mut [u8]` by the borrows of this value.
        let map = unsafe { memmap2::MmapMut::map_mut(&self.file) };
        let map = map.map_err(Error::io(&self.folder, "map a temporary file in"))?;
        self.map = Some(map);
        Ok(())
    }

    /// Gives the bytes from `from` to `to` blocks of the disk.
    fn allocate(&self, from: u64, to: u64) -> std::io::Result<()> {
        use rustix::fs::{FallocateFlags, fallocate};
        use rustix::io::Errno;
        match fallocate(&self.file, FallocateFlags::empty(), from, to - from) {
            Ok(()) => return Ok(()),
            // Not every file system can, and zeros do the same.
            Err(Errno::OPNOTSUPP | Errno::NOSYS) => {}
            Err(error) => return Err(error.into()),
        }
        let zeros = vec![0; 1 << 20];
        let mut at = from;
        while at < to {
            let some = zeros.len().min((to - at) as usize);
            self.file.write_all_at(&zeros[..some], at)?;
            at += some as u64;
        }
        Ok(())
    }

    /// The content.
    #[inline]
    pub fn bytes(&self) -> &[u8] {
        self.map.as_deref().unwrap_or_default()
    }

    /// The content, to be changed.
    #[inline]
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        self.map.as_deref_mut().unwrap_or_default()
    }
}

/// A map that the handler knows.
#[derive(Debug)]
struct GuardedMap {
    slot: &'static Slot,
    map: memmap2::Mmap,
}

impl Drop for GuardedMap {
    fn drop(&mut self) {
        self.slot.give_back();
    }
}

/// In [`Slot::lost`]: nothing.
const NONE: usize = usize::MAX;

/// Where a map lies in memory, for the handler. Slots are never freed but used again, so that there are as many as
/// maps were open at once.
#[derive(Debug)]
struct Slot {
    /// Odd while the addresses change, and another number after it: the handler may look at any time.
    version: AtomicUsize,
    start: AtomicUsize,
    /// 0 if no map has the slot.
    end: AtomicUsize,
    /// Address of the first page that was lost.
    lost: AtomicUsize,
    next: OnceLock<&'static Slot>,
}

/// The first slot; the others hang on it.
static SLOTS: Slot = Slot::new();
/// Held by whoever takes a slot. The handler never waits for it.
static TAKING: Mutex<()> = Mutex::new(());
/// What SIGBUS did before.
static BEFORE: OnceLock<libc::sigaction> = OnceLock::new();

impl Slot {
    const fn new() -> Slot {
        Slot {
            version: AtomicUsize::new(0),
            start: AtomicUsize::new(0),
            end: AtomicUsize::new(0),
            lost: AtomicUsize::new(NONE),
            next: OnceLock::new(),
        }
    }

    /// A slot for a map.
    fn take(map: &memmap2::Mmap) -> &'static Slot {
        let _taking = TAKING.lock().unwrap_or_else(PoisonError::into_inner);
        let mut slot = &SLOTS;
        while slot.end.load(Ordering::Relaxed) != 0 {
            slot = slot.next.get_or_init(|| Box::leak(Box::new(Slot::new())));
        }
        let start = map.as_ptr() as usize;
        slot.lost.store(NONE, Ordering::Relaxed);
        slot.set(start, start + map.len());
        slot
    }

    /// The map goes: before it is unmapped, for the address may be somebody else's then.
    fn give_back(&self) {
        let _taking = TAKING.lock().unwrap_or_else(PoisonError::into_inner);
        self.set(0, 0);
    }

    fn set(&self, start: usize, end: usize) {
        self.version.fetch_add(1, Ordering::Relaxed);
        fence(Ordering::Release);
        self.start.store(start, Ordering::Relaxed);
        self.end.store(end, Ordering::Relaxed);
        self.version.fetch_add(1, Ordering::Release);
    }

    /// Start and end of the slot's map; `None` if another thread is just changing them, which the map of an address
    /// that is being read cannot meet.
    fn addresses(&self) -> Option<(usize, usize)> {
        let version = self.version.load(Ordering::Acquire);
        let addresses = (self.start.load(Ordering::Relaxed), self.end.load(Ordering::Relaxed));
        fence(Ordering::Acquire);
        (version.is_multiple_of(2) && version == self.version.load(Ordering::Relaxed)).then_some(addresses)
    }

    /// The slot in whose map an address lies, and where that ends.
    fn of_address(address: usize) -> Option<(&'static Slot, usize)> {
        let mut slots = std::iter::successors(Some(&SLOTS), |slot| slot.next.get().copied());
        slots.find_map(|slot| {
            let (start, end) = slot.addresses()?;
            (start..end).contains(&address).then_some((slot, end))
        })
    }
}

/// Lets [`on_lost_page`] handle SIGBUS, once.
fn install_handler() -> std::io::Result<()> {
    static INSTALLED: Mutex<bool> = Mutex::new(false);
    let mut installed = INSTALLED.lock().unwrap_or_else(PoisonError::into_inner);
    if *installed {
        return Ok(());
    }
    let mut before = MaybeUninit::<libc::sigaction>::zeroed();
    // SAFETY: all zeros is a `sigaction`, both pointers are valid where they are not null, and the handler keeps to what
    // signal handlers may do: atomics, `mmap`, `sigaction` and `raise`.
    let result = unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = on_lost_page as *const () as usize;
        action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
        libc::sigemptyset(&mut action.sa_mask);
        if libc::sigaction(libc::SIGBUS, std::ptr::null(), before.as_mut_ptr()) == 0 {
            BEFORE.get_or_init(|| before.assume_init());
            libc::sigaction(libc::SIGBUS, &action, std::ptr::null_mut())
        } else {
            -1
        }
    };
    if result != 0 {
        return Err(std::io::Error::last_os_error());
    }
    *installed = true;
    Ok(())
}

/// SIGBUS: puts zeros in the place of what a map has lost, or passes the signal on.
extern "C" fn on_lost_page(signal: c_int, info: *mut libc::siginfo_t, _context: *mut c_void) {
    // SAFETY: the system gives a valid description to handlers with SA_SIGINFO. Signals that a program sends have no
    // address; their code is not above 0.
    let (address, is_fault) = unsafe { ((*info).si_addr() as usize, (*info).si_code > 0) };
    if let Some((slot, end)) = Slot::of_address(address).filter(|_| is_fault) {
        let page = address - address % page_bytes();
        let flags = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_FIXED;
        // SAFETY: whole pages of a map that this module has made and that is in use, since a thread has just read from it;
        // the map is read-only, and what replaces it is as readable.
        let zeros = unsafe { libc::mmap(page as *mut c_void, end - page, libc::PROT_READ, flags, -1, 0) };
        if zeros != libc::MAP_FAILED {
            slot.lost.fetch_min(page, Ordering::Release);
            return;
        }
    }
    // SAFETY: what was there before is put back as it was. A fault comes again as soon as this returns.
    unsafe {
        if let Some(before) = BEFORE.get() {
            libc::sigaction(signal, before, std::ptr::null_mut());
        }
        if !is_fault {
            libc::raise(signal);
        }
    }
}

fn page_bytes() -> usize {
    // SAFETY: asks for a number.
    let bytes = unsafe { libc::sysconf(libc::_SC_PAGESIZE) };
    usize::try_from(bytes).unwrap_or(4096)
}

/// Whether a regular file begins with these bytes; false of what cannot be read.
pub fn begins_with(path: &Path, magic: &[u8]) -> bool {
    let mut start = vec![0; magic.len()];
    let is_file = std::fs::metadata(path).is_ok_and(|metadata| metadata.is_file());
    is_file && File::open(path).and_then(|mut file| file.read_exact(&mut start)).is_ok() && start == magic
}

/// Opens the regular file `path` for reading, and tells its size.
///
/// # Errors
/// If it does not exist, may not be read, or is a directory, pipe or device.
pub fn open_regular(path: &Path) -> Result<(File, u64)> {
    // Asked before opening, since opening a pipe would wait for a writer.
    let kind = std::fs::metadata(path).map_err(Error::io(path, "open"))?;
    if kind.is_dir() {
        return Err(Error::input(path, "path", "is a directory", "name a file in it"));
    }
    if !kind.is_file() {
        return Err(Error::input(
            path,
            "path",
            "is not a regular file (a pipe or a device has no places to read at)",
            "write its content to a file first",
        ));
    }
    let file = File::open(path).map_err(Error::io(path, "open"))?;
    let bytes = file.metadata().map_err(Error::io(path, "read the size"))?.len();
    Ok((file, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_content_and_empty_files() {
        let dir = tempfile::tempdir().unwrap();
        let full = dir.path().join("full");
        std::fs::write(&full, b"brick").unwrap();
        let map = MappedFile::open(&full).unwrap();
        map.advise(Access::Sequential);
        map.advise(Access::Random);
        assert_eq!((map.bytes(), map.len(), map.is_empty()), (&b"brick"[..], 5, false));

        let empty = dir.path().join("empty");
        std::fs::write(&empty, b"").unwrap();
        let map = MappedFile::open(&empty).unwrap();
        map.advise(Access::Sequential);
        assert_eq!((map.bytes(), map.len(), map.is_empty()), (&b""[..], 0, true));
    }

    /// A file of `pages` pages, mapped.
    fn mapped(dir: &Path, name: &str, pages: usize) -> (PathBuf, MappedFile) {
        let path = dir.join(name);
        std::fs::write(&path, vec![7; pages * page_bytes()]).unwrap();
        let map = MappedFile::open(&path).unwrap();
        (path, map)
    }

    fn cut(path: &Path, bytes: u64) {
        File::options().write(true).open(path).unwrap().set_len(bytes).unwrap();
    }

    #[test]
    fn a_file_cut_short_reads_as_zeros_and_is_told_of() {
        let dir = tempfile::tempdir().unwrap();
        let page = page_bytes();
        let (path, map) = mapped(dir.path(), "cut", 10);
        let (_, whole) = mapped(dir.path(), "whole", 10);
        assert!(map.check().is_ok());
        cut(&path, 3 * page as u64 + 5);
        // From several threads, and from the back first.
        std::thread::scope(|scope| {
            for from in [8, 6, 4, 9] {
                let map = &map;
                scope.spawn(move || assert!(map.bytes()[from * page..].iter().all(|&b| b == 0)));
            }
        });
        assert!(map.bytes()[..3 * page + 5].iter().all(|&b| b == 7));
        assert_eq!(map.lost(), Some(4 * page as u64));
        let text = map.check().unwrap_err().to_string();
        assert!(text.contains(&format!("cut: byte {}: cannot be read any more", 4 * page)), "{text}");
        assert!(!text.contains('\n'));
        // The others stay as they are, and slots are used again.
        assert!(whole.bytes().iter().all(|&b| b == 7) && whole.lost().is_none() && whole.check().is_ok());
        drop(map);
        let (_, next) = mapped(dir.path(), "next", 2);
        assert!(next.lost().is_none() && next.check().is_ok());
    }

    #[test]
    fn a_file_that_changes_is_told_of_and_one_that_is_replaced_is_none() {
        let dir = tempfile::tempdir().unwrap();
        let (path, map) = mapped(dir.path(), "x", 2);
        // Within the last page, where no signal comes.
        cut(&path, map.len() - 1);
        assert!(map.lost().is_none());
        assert!(map.check().unwrap_err().to_string().contains("has been changed since it was opened"));

        let (path, map) = mapped(dir.path(), "y", 2);
        let file = File::options().write(true).open(&path).unwrap();
        let opened = file.metadata().unwrap().modified().unwrap();
        file.set_modified(opened + Duration::from_secs(1)).unwrap();
        assert!(map.check().is_ok(), "rounded");
        file.set_modified(opened - Duration::from_secs(5)).unwrap();
        assert!(map.check().is_err());

        let (path, map) = mapped(dir.path(), "z", 2);
        std::fs::write(dir.path().join("other"), b"other").unwrap();
        std::fs::rename(dir.path().join("other"), &path).unwrap();
        assert!(map.check().is_ok() && map.bytes().iter().all(|&b| b == 7));
        std::fs::remove_file(&path).unwrap();
        assert!(map.check().is_ok());
    }

    #[test]
    fn a_temporary_map_grows_and_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let mut map = TemporaryMap::new(dir.path()).unwrap();
        assert!(map.bytes().is_empty() && map.bytes_mut().is_empty());
        map.grow(3).unwrap();
        map.bytes_mut().copy_from_slice(b"abc");
        map.grow(10_000).unwrap();
        map.grow(5).unwrap();
        assert!(map.bytes().starts_with(b"abc\0") && map.bytes().len() == 10_000);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        let text = map.grow(1 << 60).unwrap_err().to_string();
        assert!(text.contains("cannot write a temporary file in") && !text.contains('\n'), "{text}");
        assert!(TemporaryMap::new(&dir.path().join("none")).is_err());
    }

    #[test]
    fn slots_are_as_many_as_maps_are_open() {
        let dir = tempfile::tempdir().unwrap();
        let maps: Vec<MappedFile> = (0..50).map(|n| mapped(dir.path(), &n.to_string(), 1).1).collect();
        for map in &maps {
            let address = map.bytes().as_ptr() as usize;
            let (slot, end) = Slot::of_address(address + 1).expect("it is known");
            assert!(std::ptr::eq(slot, map.map.as_ref().unwrap().slot));
            assert_eq!(end, address + page_bytes());
        }
        let slots = || std::iter::successors(Some(&SLOTS), |slot| slot.next.get().copied()).count();
        let most = slots();
        drop(maps);
        for _ in 0..50 {
            mapped(dir.path(), "one", 1);
        }
        // Other tests may have maps open meanwhile.
        assert!(slots() <= most + 10, "{} after {most}", slots());
    }

    #[test]
    fn refuses_what_is_no_file() {
        let dir = tempfile::tempdir().unwrap();
        let text = MappedFile::open(dir.path()).unwrap_err().to_string();
        assert!(text.contains("is a directory"), "{text}");
        let text = MappedFile::open(&dir.path().join("none")).unwrap_err().to_string();
        assert!(text.contains("cannot open"), "{text}");
        #[cfg(unix)]
        {
            let text = MappedFile::open(Path::new("/dev/zero")).unwrap_err().to_string();
            assert!(text.contains("not a regular file"), "{text}");
        }
    }
}
