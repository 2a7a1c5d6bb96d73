//! Writing a file back to the disk while it is still growing, so that little is left to wait for when it is complete.

use super::DiskFile;
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Bytes after which writing back is asked for. At the end at most these and those of a turn in work are left.
const STEP_BYTES: u64 = 8 << 20;

/// A thread that makes durable what has been written so far, again and again; none for small files.
#[derive(Default)]
pub struct WriteBack {
    asked_at: u64,
    thread: Option<(SyncSender<()>, JoinHandle<io::Result<()>>)>,
}

impl WriteBack {
    /// To be called with the number of bytes written so far.
    pub fn wrote(&mut self, file: &Arc<dyn DiskFile>, written: u64) {
        if written.saturating_sub(self.asked_at) < STEP_BYTES {
            return;
        }
        self.asked_at = written;
        if self.thread.is_none() {
            // Without a thread only time is lost.
            self.thread = start(file).ok();
        }
        if let Some((ask, _)) = &self.thread {
            // A turn that is asked for already will do, and a thread that has failed tells so at the end.
            let _ = ask.try_send(());
        }
    }

    /// Waits until the thread has ended.
    ///
    /// # Errors
    /// What it met: the system tells of a failed write once, so the caller's own attempt need not fail.
    pub fn finish(&mut self) -> io::Result<()> {
        let Some((ask, thread)) = self.thread.take() else { return Ok(()) };
        drop(ask);
        thread.join().expect("the thread does not panic")
    }
}

fn start(file: &Arc<dyn DiskFile>) -> io::Result<(SyncSender<()>, JoinHandle<io::Result<()>>)> {
    let file = Arc::clone(file);
    let (ask, asked): (_, Receiver<()>) = sync_channel(1);
    let work = move || asked.iter().try_for_each(|()| file.sync());
    Ok((ask, std::thread::Builder::new().name("write back".into()).spawn(work)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_files_need_no_thread_and_large_ones_get_one() {
        let file: Arc<dyn DiskFile> = Arc::new(tempfile::tempfile().unwrap());
        let mut write_back = WriteBack::default();
        write_back.wrote(&file, STEP_BYTES - 1);
        assert!(write_back.thread.is_none());
        (1..9).for_each(|turn| write_back.wrote(&file, turn * STEP_BYTES));
        assert!(write_back.thread.is_some());
        write_back.finish().unwrap();
        assert!(write_back.finish().is_ok() && write_back.thread.is_none());
    }

    #[test]
    fn what_the_thread_meets_is_told() {
        let (reader, _writer) = std::os::unix::net::UnixStream::pair().unwrap();
        let mut write_back = WriteBack::default();
        // Sockets cannot be synchronized.
        let file: Arc<dyn DiskFile> = Arc::new(std::fs::File::from(std::os::fd::OwnedFd::from(reader)));
        write_back.wrote(&file, STEP_BYTES);
        assert!(write_back.finish().is_err());
    }
}
