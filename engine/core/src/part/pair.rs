//! A file and another that describes it.

use super::PartFile;
use crate::error::{Error, Result};
use std::path::Path;

/// Two files of which the second describes the first. At no moment does one of a former pair stand beside one of this: if
/// the power goes while they get their names, the description may be missing, but it is never another's.
pub struct PartPair {
    /// What is described.
    pub file: PartFile,
    /// The description.
    pub description: PartFile,
}

impl PartPair {
    /// Creates both.
    ///
    /// # Errors
    /// As [`PartFile::create`].
    pub fn create(file: &Path, description: &Path) -> Result<PartPair> {
        Ok(PartPair { file: PartFile::create(file)?, description: PartFile::create(description)? })
    }

    /// Makes both durable and gives them their names.
    ///
    /// # Errors
    /// As [`PartFile::finish`]. Until both are durable an older pair stays; what fails after that leaves one of the files
    /// without the other, and no mixed pair.
    pub fn finish(&mut self) -> Result<()> {
        let PartPair { file, description } = self;
        file.settle()?;
        description.settle()?;
        description.withdraw()?;
        file.finish()?;
        description.finish()
    }
}

impl PartFile {
    /// Makes what was written so far durable, under the unfinished name.
    ///
    /// # Errors
    /// As [`PartFile::finish`].
    pub fn settle(&mut self) -> Result<()> {
        self.sync().map_err(Error::io(&self.path, "write"))
    }

    /// Removes an older file of the final name for good.
    fn withdraw(&self) -> Result<()> {
        let there = self.disk.exists(&self.path).map_err(Error::io(&self.path, "inspect"))?;
        if !there {
            return Ok(());
        }
        let removed = self.disk.remove(&self.path).and_then(|()| self.disk.sync_directory(&self.path));
        removed.map_err(Error::io(&self.path, "remove the older file"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::disk::Disk;
    use crate::disk::sim::{Crash, DiskFault, SimDisk, SimRng, image};
    use std::collections::BTreeMap;
    use std::path::PathBuf;
    use std::sync::Arc;

    const NAMES: [&str; 2] = ["w.npy", "w.json"];

    fn write(disk: Arc<dyn Disk>) -> Result<()> {
        let create = |name| PartFile::create_on(Arc::clone(&disk), Path::new(name));
        let mut pair = PartPair { file: create(NAMES[0])?, description: create(NAMES[1])? };
        pair.file.append(b"new")?;
        pair.description.append(b"new")?;
        pair.finish()
    }

    fn old() -> BTreeMap<PathBuf, Vec<u8>> {
        NAMES.iter().map(|name| (PathBuf::from(name), b"old".to_vec())).collect()
    }

    /// The two files must be of one pair as far as both are there; returns that of the file.
    fn check(files: &BTreeMap<PathBuf, Vec<u8>>, when: &str) -> Option<Vec<u8>> {
        let [file, description] = NAMES.map(|name| files.get(Path::new(name)).cloned());
        assert!(file.is_none() || description.is_none() || file == description, "{when}: a mixed pair");
        assert!(file.as_deref() == Some(b"new") || file.as_deref() == Some(b"old"), "{when}: no file");
        file
    }

    #[test]
    fn power_cuts_and_failures_leave_no_mixed_pair() {
        let disk = SimDisk::holding(&old());
        write(Arc::new(disk.clone())).unwrap();
        assert_eq!(check(&disk.files(), "in the end").as_deref(), Some(&b"new"[..]));
        assert_eq!(disk.files().len(), 2);
        let (log, mut rng) = (disk.log(), SimRng(5));
        for cut in 0..=log.len() {
            for crash in [Crash::Dropped, Crash::Kept, Crash::Reordered, Crash::Torn] {
                for _ in 0..20 {
                    let files = image(&old(), &log[..cut], crash, &mut rng);
                    check(&files, &format!("cut {cut}, {crash:?}"));
                    let again = SimDisk::holding(&files);
                    write(Arc::new(again.clone())).unwrap();
                    assert_eq!(again.files(), disk.files());
                }
            }
        }
        for at in 0..disk.calls() {
            for fault in [DiskFault::Broken, DiskFault::Full, DiskFault::Short, DiskFault::Kill] {
                let disk = SimDisk::holding(&old());
                disk.plan(at, fault);
                let written = write(Arc::new(disk.clone()));
                disk.revive();
                let file = check(&disk.files(), &format!("call {at}, {fault:?}"));
                assert!(written.is_err() || file.as_deref() == Some(b"new"));
            }
        }
    }
}
