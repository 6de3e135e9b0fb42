//! An allocator that counts for each thread by itself, so that tests and the harness around them do not disturb each other.
#![allow(unsafe_code, reason = "an allocator that counts can only be installed through an unsafe trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    // constant and without a destructor: reaching it allocates nothing
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
    /// What was asked for on this thread, whether it was given back or not.
    pub static BYTES: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        BYTES.set(BYTES.get() + layout.size());
        System.alloc(layout)
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        System.dealloc(pointer, layout);
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// How often `f` allocates on the thread that calls it.
///
/// # Panics
/// If the counter does not count.
pub fn allocations<R>(f: impl FnOnce() -> R) -> (R, usize) {
    let start = ALLOCATIONS.get();
    std::hint::black_box(vec![1.0; 3]);
    let before = ALLOCATIONS.get();
    assert!(before > start, "the counter counts");
    let result = f();
    (result, ALLOCATIONS.get() - before)
}
