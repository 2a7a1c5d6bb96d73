//! What a build may take of the machine.

use crate::backend::Vulkan;
use crate::error::Result;
use crate::large_array::ArrayRoom;
use crate::part::directory_of;
use crate::part::temporary::{TempFile, require_folder};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a build may take of the machine. The store is the same whatever it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Resources {
    /// Bytes of memory for pieces, subtrees in work, records that wait for their turn, and the index of nodes.
    /// Beside those a thread takes some 8 MB of its own, and a parsed input what it takes. Soups of triangles that
    /// are closed, refined where triangles are, obey it; other builds hold their pieces in memory.
    pub memory: u64,
    /// Bytes of it that the index of nodes may take. A build whose index outgrows them ends with an error and keeps what it
    /// has, from where the same build goes on with more.
    pub index: u64,
    /// Folder of the temporary file that is used if the pieces do not fit in memory; the output's own by default.
    pub temp_dir: Option<PathBuf>,
    /// A device for the bricks of closed soups, and for the sums over the caps of open ones. Everything else is the processor's.
    pub device: Option<Vulkan>,
}

/// Share of the memory that one array of a point cloud may have. No more than four are as large as that at once.
const ARRAY_SHARE: u64 = 16;

impl Resources {
    /// The room of each array of the points from which `output` is built; what is larger goes to the folder of temporary
    /// files.
    pub fn array_room(&self, output: &Path) -> ArrayRoom {
        if self.memory == u64::MAX {
            return ArrayRoom::unbounded();
        }
        let folder = self.temp_dir.as_deref().unwrap_or(directory_of(output));
        ArrayRoom::new(self.memory / ARRAY_SHARE, folder)
    }
}

impl Default for Resources {
    /// No bound.
    fn default() -> Self {
        Resources { memory: u64::MAX, index: u64::MAX, temp_dir: None, device: None }
    }
}

/// [`Resources`] with a place.
pub(super) struct SpillResources {
    memory: u64,
    index: u64,
    file: Arc<TempFile>,
}

impl SpillResources {
    /// For building `output`.
    ///
    /// # Errors
    /// If the folder for temporary files is none.
    pub fn new(resources: &Resources, output: &Path) -> Result<SpillResources> {
        let folder = resources.temp_dir.as_deref().unwrap_or(directory_of(output));
        require_folder(folder)?;
        let Resources { memory, index, .. } = *resources;
        Ok(SpillResources { memory, index, file: Arc::new(TempFile::new(folder)) })
    }

    /// Without bound.
    pub fn unbounded() -> SpillResources {
        let file = Arc::new(TempFile::new(&std::env::temp_dir()));
        SpillResources { memory: u64::MAX, index: u64::MAX, file }
    }

    /// Bytes for everything.
    pub fn memory(&self) -> u64 {
        self.memory
    }

    /// Takes some of them away for good.
    pub fn take(&mut self, bytes: u64) {
        self.memory = self.memory.saturating_sub(bytes);
    }

    /// Those of them that the index may take.
    pub fn index(&self) -> u64 {
        self.index
    }

    /// Bytes for the sorted pieces; jobs need the rest.
    pub fn sorted_bytes(&self) -> u64 {
        self.memory / 4 * 3
    }

    /// The temporary file.
    pub fn file(&self) -> Arc<TempFile> {
        Arc::clone(&self.file)
    }
}
