//! A disk in memory that can fail at any call, and that knows what a crash may leave.

use super::{Disk, DiskFile};
use std::collections::{BTreeMap, BTreeSet};
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};

/// Smallest piece of a write that survives as a whole.
const SECTOR_BYTES: u64 = 512;

/// What goes wrong at a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DiskFault {
    /// The system reports an error.
    Broken,
    /// The disk is full; a write gets half way.
    Full,
    /// A write gets half way and says so; the call after it fails.
    Short,
    /// The program ends: a write gets half way, and nothing comes after it.
    Kill,
}

/// What goes wrong as something is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadFault {
    /// The system reports an error.
    Broken,
    /// Half of what was asked for comes, which is no error.
    Short,
    /// The file seems to end.
    Cut,
    /// A bit is another.
    Flipped,
}

/// A call that changed something, as it is replayed.
#[derive(Clone, Debug)]
pub enum Op {
    Create(PathBuf, usize),
    Write(usize, u64, Vec<u8>),
    SetSize(usize, u64),
    Sync(usize),
    /// What was not durable never will be, though whoever reads the file sees it.
    SyncFailed(usize),
    Rename(PathBuf, PathBuf),
    Remove(PathBuf),
    SyncDirectory,
    /// The writer was told that so many nodes are safe.
    Committed(usize),
    /// The writer was told that the store is finished.
    Finished,
}

#[derive(Default)]
struct State {
    names: BTreeMap<PathBuf, usize>,
    inodes: Vec<Vec<u8>>,
    locked: BTreeSet<usize>,
    log: Vec<Op>,
    calls: usize,
    fault: Option<(usize, DiskFault)>,
    dead: bool,
    reads: usize,
    read_fault: Option<(usize, ReadFault)>,
}

/// The disk.
#[derive(Clone, Default)]
pub struct SimDisk(Arc<Mutex<State>>);

struct SimFile {
    disk: SimDisk,
    inode: usize,
}

impl State {
    /// Counts a call that changes something; says how much of `length` bytes it may write.
    fn call(&mut self, length: usize) -> Result<usize> {
        if self.dead {
            return Err(Error::other("the program has ended"));
        }
        self.calls += 1;
        match self.fault {
            Some((at, fault)) if at + 1 == self.calls => match fault {
                DiskFault::Broken => Err(Error::other("broken")),
                DiskFault::Full if length < 2 => Err(ErrorKind::StorageFull.into()),
                DiskFault::Full | DiskFault::Short => {
                    self.fault = Some((self.calls, DiskFault::Broken));
                    Ok((length / 2).max(length.min(1)))
                }
                DiskFault::Kill => {
                    self.dead = true;
                    Ok(length / 2)
                }
            },
            _ => Ok(length),
        }
    }

    /// As [`State::call`], of a call that is done or not.
    fn step(&mut self) -> Result<()> {
        self.call(0)?;
        if self.dead { Err(Error::other("the program has ended")) } else { Ok(()) }
    }

    fn apply(&mut self, op: Op) {
        apply(&op, &mut self.names, &mut self.inodes);
        self.log.push(op);
    }
}

/// What a call does, as seen by whoever looks before a crash.
fn apply(op: &Op, names: &mut BTreeMap<PathBuf, usize>, inodes: &mut [Vec<u8>]) {
    match op {
        Op::Create(path, inode) => {
            names.insert(path.clone(), *inode);
        }
        Op::Write(inode, offset, bytes) => {
            let file = &mut inodes[*inode];
            let end = *offset as usize + bytes.len();
            file.resize(file.len().max(end), 0);
            file[*offset as usize..end].copy_from_slice(bytes);
        }
        Op::SetSize(inode, size) => inodes[*inode].resize(*size as usize, 0),
        Op::Rename(from, to) => {
            if let Some(inode) = names.remove(from) {
                names.insert(to.clone(), inode);
            }
        }
        Op::Remove(path) => drop(names.remove(path)),
        Op::Sync(_) | Op::SyncFailed(_) | Op::SyncDirectory | Op::Committed(_) | Op::Finished => {}
    }
}

impl SimDisk {
    /// A disk that holds some files, for good.
    pub fn holding(files: &BTreeMap<PathBuf, Vec<u8>>) -> SimDisk {
        let state = State {
            names: files.keys().cloned().zip(0..).collect(),
            inodes: files.values().cloned().collect(),
            ..State::default()
        };
        SimDisk(Arc::new(Mutex::new(state)))
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap()
    }

    /// Lets the call number `at` from now, counted from 0, go wrong.
    pub fn plan(&self, at: usize, fault: DiskFault) {
        let mut state = self.lock();
        state.fault = Some((state.calls + at, fault));
    }

    /// Lets the reading number `at` from now, counted from 0, go wrong.
    pub fn plan_read(&self, at: usize, fault: ReadFault) {
        let mut state = self.lock();
        state.read_fault = Some((state.reads + at, fault));
    }

    /// Readings so far.
    pub fn reads(&self) -> usize {
        self.lock().reads
    }

    /// As after starting the program once more, on a sound disk.
    pub fn revive(&self) {
        let mut state = self.lock();
        (state.dead, state.fault) = (false, None);
    }

    /// Calls so far that changed something.
    pub fn calls(&self) -> usize {
        self.lock().calls
    }

    /// What was done, with the notes.
    pub fn log(&self) -> Vec<Op> {
        self.lock().log.clone()
    }

    /// Notes what the writer was told.
    pub fn note(&self, op: Op) {
        let mut state = self.lock();
        if !state.dead {
            state.log.push(op);
        }
    }

    /// What the files hold.
    pub fn files(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let state = self.lock();
        state.names.iter().map(|(path, inode)| (path.clone(), state.inodes[*inode].clone())).collect()
    }

    fn open(&self, path: &Path) -> Result<Option<usize>> {
        let mut state = self.lock();
        let inode = match state.names.get(path) {
            Some(inode) => *inode,
            None => {
                state.step()?;
                let inode = state.inodes.len();
                state.inodes.push(Vec::new());
                state.apply(Op::Create(path.to_owned(), inode));
                inode
            }
        };
        Ok(state.locked.insert(inode).then_some(inode))
    }
}

impl Disk for SimDisk {
    fn open_locked(&self, path: &Path) -> Result<Option<Arc<dyn DiskFile>>> {
        let inode = self.open(path)?;
        Ok(inode.map(|inode| Arc::new(SimFile { disk: self.clone(), inode }) as Arc<dyn DiskFile>))
    }

    fn exists(&self, path: &Path) -> Result<bool> {
        Ok(self.lock().names.contains_key(path))
    }

    fn rename(&self, from: &Path, to: &Path) -> Result<()> {
        let mut state = self.lock();
        state.step()?;
        state.apply(Op::Rename(from.to_owned(), to.to_owned()));
        Ok(())
    }

    fn remove(&self, path: &Path) -> Result<()> {
        let mut state = self.lock();
        state.step()?;
        state.apply(Op::Remove(path.to_owned()));
        Ok(())
    }

    fn sync_directory(&self, _: &Path) -> Result<()> {
        let mut state = self.lock();
        state.step()?;
        state.apply(Op::SyncDirectory);
        Ok(())
    }
}

impl DiskFile for SimFile {
    fn size(&self) -> Result<u64> {
        Ok(self.disk.lock().inodes[self.inode].len() as u64)
    }

    fn read_at(&self, bytes: &mut [u8], offset: u64) -> Result<usize> {
        let mut state = self.disk.lock();
        state.reads += 1;
        let fault = state.read_fault.filter(|(at, _)| at + 1 == state.reads).map(|(_, fault)| fault);
        let from = state.inodes[self.inode].get(offset as usize..).unwrap_or_default();
        let count = match fault {
            Some(ReadFault::Broken) => return Err(Error::other("broken")),
            Some(ReadFault::Cut) => 0,
            Some(ReadFault::Short) => from.len().min(bytes.len().div_ceil(2)),
            Some(ReadFault::Flipped) | None => from.len().min(bytes.len()),
        };
        bytes[..count].copy_from_slice(&from[..count]);
        if fault == Some(ReadFault::Flipped) && count > 0 {
            bytes[count / 2] ^= 4;
        }
        Ok(count)
    }

    fn write_at(&self, bytes: &[u8], offset: u64) -> Result<usize> {
        let mut state = self.disk.lock();
        let count = state.call(bytes.len())?;
        state.apply(Op::Write(self.inode, offset, bytes[..count].to_vec()));
        if state.dead { Err(Error::other("the program has ended")) } else { Ok(count) }
    }

    fn set_size(&self, bytes: u64) -> Result<()> {
        let mut state = self.disk.lock();
        state.step()?;
        state.apply(Op::SetSize(self.inode, bytes));
        Ok(())
    }

    fn sync(&self) -> Result<()> {
        let mut state = self.disk.lock();
        let step = state.step();
        let op = if step.is_ok() { Op::Sync(self.inode) } else { Op::SyncFailed(self.inode) };
        state.apply(op);
        step
    }
}

impl Drop for SimFile {
    fn drop(&mut self) {
        self.disk.lock().locked.remove(&self.inode);
    }
}

/// Chance that a test can repeat.
pub struct SimRng(pub u64);

impl SimRng {
    /// A number below `bound`.
    pub fn below(&mut self, bound: usize) -> usize {
        // Knuth's MMIX generator; its high bits are good enough to choose by.
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % bound
    }
}

/// How a crash treats what was not made durable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Crash {
    /// All of it is lost.
    Dropped,
    /// All of it is there.
    Kept,
    /// Any calls of it, in whatever order the disk had taken them.
    Reordered,
    /// Any sectors of it.
    Torn,
}

/// What a disk that held `before` may hold after these calls and a crash.
pub fn image(
    before: &BTreeMap<PathBuf, Vec<u8>>,
    log: &[Op],
    crash: Crash,
    rng: &mut SimRng,
) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut names: BTreeMap<PathBuf, usize> = before.keys().cloned().zip(0..).collect();
    let mut inodes: Vec<Vec<u8>> = before.values().cloned().collect();
    let (mut of_files, mut of_names): (Vec<Op>, Vec<Op>) = (Vec::new(), Vec::new());
    for op in log {
        match op {
            Op::Create(_, inode) => {
                inodes.resize(inodes.len().max(inode + 1), Vec::new());
                of_names.push(op.clone());
            }
            Op::Rename(..) | Op::Remove(_) => of_names.push(op.clone()),
            Op::Write(..) | Op::SetSize(..) => of_files.push(op.clone()),
            Op::Sync(inode) => {
                for op in of_files.extract_if(.., |op| touches(op, *inode)) {
                    apply(&op, &mut names, &mut inodes);
                }
            }
            Op::SyncFailed(inode) => drop(of_files.extract_if(.., |op| touches(op, *inode)).count()),
            Op::SyncDirectory => of_names.drain(..).for_each(|op| apply(&op, &mut names, &mut inodes)),
            Op::Committed(_) | Op::Finished => {}
        }
    }
    let survives = |rng: &mut SimRng| match crash {
        Crash::Dropped => false,
        Crash::Kept => true,
        Crash::Reordered | Crash::Torn => rng.below(2) == 0,
    };
    for op in of_names.iter().chain(&of_files) {
        match op {
            Op::Write(inode, offset, bytes) if crash == Crash::Torn => {
                let mut from = 0;
                while from < bytes.len() {
                    let at = offset + from as u64;
                    let end = bytes.len().min(((at / SECTOR_BYTES + 1) * SECTOR_BYTES - offset) as usize);
                    if survives(rng) {
                        let sector = Op::Write(*inode, at, bytes[from..end].to_vec());
                        apply(&sector, &mut names, &mut inodes);
                    }
                    from = end;
                }
            }
            op if survives(rng) => apply(op, &mut names, &mut inodes),
            _ => {}
        }
    }
    names.into_iter().map(|(path, inode)| (path, std::mem::take(&mut inodes[inode]))).collect()
}

fn touches(op: &Op, inode: usize) -> bool {
    matches!(op, Op::Write(of, ..) | Op::SetSize(of, _) if *of == inode)
}
