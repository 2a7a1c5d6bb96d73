//! The library's error type: what went wrong, in which file and where, and what to do.

use std::io;
use std::path::{Path, PathBuf};

/// Result with [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Everything that can fail. The display form is one line fit for an end user.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused something.
    #[error("{path}: cannot {action}: {source}; {remedy}", path = path.display(), remedy = remedy(source.kind()))]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried, as in "open", "write", "read".
        action: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// An input file is not what it should be.
    #[error("{path}: {place}: {what}; {remedy}", path = path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// Line, byte or facet.
        place: String,
        /// What is wrong.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// A store is damaged or of another kind.
    #[error("{path}: {place}: {what}; {remedy}", path = path.display())]
    Store {
        /// The file.
        path: PathBuf,
        /// Header, index or record with its key.
        place: String,
        /// What is wrong.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// A setting does not fit.
    #[error("{what}; {remedy}")]
    Setting {
        /// What is wrong.
        what: String,
        /// What the user can do.
        remedy: String,
    },
    /// A device computed a brick otherwise than the processor.
    #[error(
        "{device} ({driver}): brick {node} is not what the processor computes; update the driver, or use `backend` cpu"
    )]
    Distrusted {
        /// The device's name.
        device: String,
        /// Its driver's name and version.
        driver: String,
        /// The node's key.
        node: String,
    },
    /// The user asked to stop.
    #[error("interrupted; nothing was written under the final name")]
    Interrupted,
    /// The user asked to stop, and what there was is safe.
    #[error(
        "interrupted; {part} holds the {nodes} nodes so far, and the same command goes on from there",
        part = part.display()
    )]
    Suspended {
        /// The unfinished file.
        part: PathBuf,
        /// Nodes in it.
        nodes: u64,
    },
}

/// What kind of failure an [`Error`] is, for programs that go on in different ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The operating system refused something: a missing file, a full disk.
    Io,
    /// An input is damaged, or not of a kind that is read.
    Input,
    /// A store is damaged or of another kind.
    Store,
    /// A setting makes no sense, or does not fit the input.
    Setting,
    /// A device computes otherwise than the processor.
    Device,
    /// The caller asked to stop.
    Interrupted,
}

/// What the user can do where the system refuses something.
fn remedy(kind: io::ErrorKind) -> &'static str {
    match kind {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => {
            "check the path: a file or a folder of it is not there"
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "choose another place, or see to it that this one may be used"
        }
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => {
            "make room there, or choose another disk"
        }
        io::ErrorKind::IsADirectory | io::ErrorKind::InvalidFilename => "name a file",
        io::ErrorKind::BrokenPipe => "nobody reads what is written",
        io::ErrorKind::OutOfMemory => "leave the system more memory",
        _ => "check the disk, or the network behind it, and try again",
    }
}

impl Error {
    /// The kind of failure.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Error::Io { .. } => ErrorKind::Io,
            Error::Input { .. } => ErrorKind::Input,
            Error::Store { .. } => ErrorKind::Store,
            Error::Setting { .. } => ErrorKind::Setting,
            Error::Distrusted { .. } => ErrorKind::Device,
            Error::Interrupted | Error::Suspended { .. } => ErrorKind::Interrupted,
        }
    }

    /// For `map_err` on I/O results.
    pub fn io(path: &Path, action: &'static str) -> impl FnOnce(std::io::Error) -> Error {
        let path = path.to_owned();
        move |source| Error::Io { path, action, source }
    }

    /// An [`Error::Input`].
    pub fn input(path: &Path, place: impl ToString, what: impl ToString, remedy: impl ToString) -> Error {
        let (place, what, remedy) = (place.to_string(), what.to_string(), remedy.to_string());
        Error::Input { path: path.to_owned(), place, what, remedy }
    }

    /// An [`Error::Store`].
    pub fn store(path: &Path, place: impl ToString, what: impl ToString, remedy: impl ToString) -> Error {
        let (place, what, remedy) = (place.to_string(), what.to_string(), remedy.to_string());
        Error::Store { path: path.to_owned(), place, what, remedy }
    }

    /// An [`Error::Setting`].
    pub fn setting(what: impl ToString, remedy: impl ToString) -> Error {
        Error::Setting { what: what.to_string(), remedy: remedy.to_string() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_refuses_comes_with_a_remedy() {
        for (code, remedy) in
            [(2, "check the path"), (13, "another place"), (28, "make room"), (21, "name a file")]
        {
            let error = Error::io(Path::new("a/b.brf"), "create")(io::Error::from_raw_os_error(code));
            let line = error.to_string();
            assert!(line.starts_with("a/b.brf: cannot create: ") && line.contains(remedy), "{line}");
            assert!(!line.contains('\n'), "{line}");
        }
    }
}
