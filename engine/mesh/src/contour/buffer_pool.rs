//! Room that has been used before.

use std::sync::{Mutex, PoisonError};

/// Room to be used again: fresh pages from the kernel cost a tenth of the time of contouring.
pub(super) struct BufferPool<T>(Mutex<Vec<Vec<T>>>);

impl<T> Default for BufferPool<T> {
    fn default() -> BufferPool<T> {
        BufferPool(Mutex::default())
    }
}

impl<T> BufferPool<T> {
    /// Empty room.
    pub(super) fn take(&self) -> Vec<T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    /// Keeps what is used no more.
    pub(super) fn keep(&self, mut room: Vec<T>) {
        room.clear();
        if room.capacity() > 0 {
            self.0.lock().unwrap_or_else(PoisonError::into_inner).push(room);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_comes_back_empty() {
        let spare = BufferPool::default();
        assert_eq!(spare.take().capacity(), 0);
        spare.keep(vec![1, 2, 3]);
        spare.keep(Vec::new());
        let room = spare.take();
        assert!(room.is_empty() && room.capacity() >= 3);
        assert_eq!(spare.take().capacity(), 0);
    }
}
