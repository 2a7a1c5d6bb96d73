//! A folder that gets its name when all in it is complete.

use super::{directory_of, part_path};
use crate::error::{Error, Result};
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
    /// Creates the unfinished folder.
    ///
    /// # Errors
    /// If `name` is there and no folder, or the unfinished folder cannot be created.
    pub fn create(name: &Path) -> Result<PartFolder> {
        if name.exists() && !name.is_dir() {
            let source = io::Error::new(io::ErrorKind::AlreadyExists, "a file of that name is there");
            return Err(Error::io(name, "write the folder")(source));
        }
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
            let mut folder = PartFolder::create(&name).unwrap();
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
        assert!(PartFolder::create(&place.path().join("plain")).is_err());
    }
}
