//! Counts heap allocations, so that "this path allocates nothing" is a test.
//!
//! ```
//! use r6_testkit::alloc::{CountingAllocator, allocations_during};
//!
//! #[global_allocator]
//! static ALLOCATOR: CountingAllocator = CountingAllocator;
//!
//! let mut buffer = Vec::with_capacity(8);
//! assert_eq!(allocations_during(|| buffer.extend_from_slice(b"{}")), 0);
//! ```

#![allow(
    unsafe_code,
    reason = "a global allocator cannot be written without it; every call is passed on to `System`"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

thread_local! {
    // Constant and without a destructor, so that access never allocates, not even in a thread that is ending.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, which also counts the memory requests of each thread.
///
/// A reallocation that grows or shrinks counts as one. Freeing memory does not count.
#[derive(Debug, Clone, Copy, Default)]
pub struct CountingAllocator;

fn count_one() {
    // This fails only after the thread's storage is gone, when no test runs in the thread any more.
    let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every method passes its arguments unchanged to `System` and returns its result unchanged.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count_one();
        // SAFETY: the caller keeps the contract of `GlobalAlloc::alloc`, which is the same as that of
        // `System`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count_one();
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        count_one();
        // SAFETY: as above; the pointer came from `System`, because no other allocator is used here.
        unsafe { System.realloc(pointer, layout, new_size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Counts the allocations of this thread while `work` runs.
///
/// Panics if [`CountingAllocator`] is not the `#[global_allocator]` of the test binary, because every count
/// would then be zero and every test would pass.
pub fn allocations_during(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.get();
    drop(black_box(Box::new(black_box(0_u8))));
    assert!(
        ALLOCATIONS.get() > before,
        "CountingAllocator is not the #[global_allocator] of this test binary"
    );

    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
}

#[cfg(test)]
mod tests {
    use super::*;

    // The unit tests of this crate use the usual allocator; `tests/alloc.rs` uses the counting one.
    #[test]
    #[should_panic(expected = "not the #[global_allocator]")]
    fn counting_without_the_counting_allocator_is_refused() {
        let _ = allocations_during(|| ());
    }
}
