//! Decoders of other crates, which may panic on damaged bytes.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// Whether a panic of this thread is an answer, not a mistake to be told of.
    static IS_EXPECTED: Cell<bool> = const { Cell::new(false) };
}

static HOOK: Once = Once::new();

/// What `decode` gives, or nothing if it panics, of which nothing is told. What it changed is to be thrown away then.
pub(super) fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |told| {
            if !IS_EXPECTED.get() {
                before(told);
            }
        }));
    });
    let was = IS_EXPECTED.replace(true);
    let decoded = panic::catch_unwind(AssertUnwindSafe(decode));
    IS_EXPECTED.set(was);
    decoded.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_no_answer() {
        assert_eq!(guarded(|| 7), Some(7));
        assert_eq!(guarded(|| [1, 2, 3][std::hint::black_box(3)]), None);
        assert_eq!(guarded(|| 8), Some(8));
    }
}
