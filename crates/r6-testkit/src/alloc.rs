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
    // Constant and without a destructor: touching it never allocates, not even in a thread that is ending.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, which also counts per thread how often it is asked for memory.
///
/// A growing or shrinking reallocation counts as one; giving memory back does not count.
#[derive(Debug, Clone, Copy, Default)]
pub struct CountingAllocator;

fn count_one() {
    // Wrong only while the thread's storage is gone, when no test runs in it any more.
    let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every method hands the caller's arguments unchanged to `System` and its result unchanged back.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count_one();
        // SAFETY: the caller keeps the contract of `GlobalAlloc::alloc`, which is that of `System`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count_one();
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        count_one();
        // SAFETY: as above; the pointer came from `System`, for no other allocator is asked here.
        unsafe { System.realloc(pointer, layout, new_size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// How many allocations this thread makes while `work` runs.
///
/// Panics where [`CountingAllocator`] is not the `#[global_allocator]` of the test binary: there every count
/// would be zero and every test on it would pass.
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

    // The unit tests of this crate run on the usual allocator; `tests/alloc.rs` runs on the counting one.
    #[test]
    #[should_panic(expected = "not the #[global_allocator]")]
    fn counting_without_the_counting_allocator_is_refused() {
        let _ = allocations_during(|| ());
    }
}
