//! A folder that gets its name when all in it is complete.

use super::{directory_of, part_path};
use crate::error::{Error, Result};
use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// A folder named `NAME.part` until it is finished; removed if it never is. A program that is killed leaves it, and the next
/// writer of the same name begins by removing it.
pub struct PartFolder {
    name: PathBuf,
    part: PathBuf,
    finished: bool,
}

impl PartFolder {
    /// Creates the unfinished folder, in whose place all of an older one goes. `is_own` knows the names of what is written into
    /// such folders.
    ///
    /// # Errors
    /// If `name` is there and no folder, or one with other things in it; if the unfinished folder cannot be created.
    pub fn create(name: &Path, is_own: impl Fn(&OsStr) -> bool) -> Result<PartFolder> {
        // A `/` behind the name, as shells complete it, is no part of it.
        let name = name.components().as_path();
        if name.exists() && !name.is_dir() {
            let (what, remedy) = ("this is a file, and a folder is to be written", "choose another name");
            return Err(Error::store(name, "output", what, remedy));
        }
        require_own(name, is_own)?;
        let part = part_path(name);
        if part.is_dir() {
            fs::remove_dir_all(&part).map_err(Error::io(&part, "remove"))?;
        } else if part.exists() {
            fs::remove_file(&part).map_err(Error::io(&part, "remove"))?;
        }
        fs::create_dir(&part).map_err(Error::io(&part, "create"))?;
        Ok(PartFolder { name: name.to_owned(), part, finished: false })
    }

    /// The unfinished folder, for what is put in it.
    pub fn path(&self) -> &Path {
        &self.part
    }

    /// Gives the folder its name. An older folder of the name is exchanged for it in one step, and then removed.
    ///
    /// # Errors
    /// If the system refuses; an older folder stays then.
    pub fn finish(&mut self) -> Result<()> {
        let error = |source: io::Error| Error::io(&self.name, "give the name to")(source);
        sync(&self.part).map_err(error)?;
        if self.name.exists() {
            exchange(&self.part, &self.name).map_err(error)?;
            self.finished = true;
            fs::remove_dir_all(&self.part).map_err(Error::io(&self.part, "remove"))?;
        } else {
            fs::rename(&self.part, &self.name).map_err(error)?;
            self.finished = true;
        }
        sync(directory_of(&self.name)).map_err(error)
    }
}

/// Refuses to replace a folder that has other things in it.
fn require_own(folder: &Path, is_own: impl Fn(&OsStr) -> bool) -> Result<()> {
    if !folder.is_dir() {
        return Ok(());
    }
    for entry in fs::read_dir(folder).map_err(Error::io(folder, "read"))? {
        let name = entry.map_err(Error::io(folder, "read"))?.file_name();
        if !is_own(&name) {
            let what = format!("it holds {}, and all in it would be replaced", name.display());
            return Err(Error::store(folder, "output", what, "write a folder of another name"));
        }
    }
    Ok(())
}

fn sync(folder: &Path) -> io::Result<()> {
    fs::File::open(folder)?.sync_all()
}

fn exchange(one: &Path, other: &Path) -> io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    Ok(renameat_with(CWD, one, CWD, other, RenameFlags::EXCHANGE)?)
}

impl Drop for PartFolder {
    fn drop(&mut self) {
        if !self.finished {
            // There is nobody to tell, and the next writer removes it.
            let _ = fs::remove_dir_all(&self.part);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_appears_whole_or_not_at_all() {
        let place = tempfile::tempdir().unwrap();
        let name = place.path().join("out.zarr");
        let write = |text: &str| {
            let mut folder = PartFolder::create(&name, |own| own == "file").unwrap();
            fs::write(folder.path().join("file"), text).unwrap();
            (text != "never").then(|| folder.finish().unwrap());
        };
        write("never");
        assert!(!name.exists());
        write("first");
        write("never");
        assert_eq!(fs::read_to_string(name.join("file")).unwrap(), "first");
        write("second");
        assert_eq!(fs::read_to_string(name.join("file")).unwrap(), "second");
        // What a killed writer left is removed.
        fs::create_dir(part_path(&name)).unwrap();
        write("third");
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 1);
        fs::write(place.path().join("plain"), "").unwrap();
        assert!(PartFolder::create(&place.path().join("plain"), |_| true).is_err());
        // A slash behind the name changes nothing, and what somebody else has put there stays.
        drop(PartFolder::create(&place.path().join("out.zarr/"), |own| own == "file").unwrap());
        fs::write(name.join("thesis"), "").unwrap();
        let refused = PartFolder::create(&name, |own| own == "file").map(|_| ()).unwrap_err().to_string();
        assert!(refused.contains("it holds thesis"), "{refused}");
        assert!(name.join("thesis").exists() && name.join("file").exists());
    }
}
