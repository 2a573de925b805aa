//! Tests the counting allocator in a binary that installs it.

use std::hint::black_box;
use std::thread;

use r6_testkit::alloc::{CountingAllocator, allocations_during};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

#[test]
fn a_box_is_one_allocation() {
    assert_eq!(allocations_during(|| drop(black_box(Box::new(black_box(7_u64))))), 1);
}

#[test]
fn growing_a_vec_counts_each_growth() {
    let mut bytes: Vec<u8> = Vec::new();
    assert_eq!(allocations_during(|| bytes.reserve_exact(16)), 1, "the first buffer");
    bytes.resize(16, 0);
    assert_eq!(allocations_during(|| bytes.reserve_exact(16)), 1, "the buffer made longer");
}

#[test]
fn a_zeroed_buffer_counts() {
    assert_eq!(allocations_during(|| drop(black_box(vec![0_u8; 4096]))), 1);
}

#[test]
fn work_on_the_stack_counts_nothing() {
    let mut sum = 0_u64;
    assert_eq!(allocations_during(|| sum = black_box([1_u64, 2, 3]).iter().sum()), 0);
    assert_eq!(sum, 6);
}

#[test]
fn other_threads_are_not_counted() {
    thread::scope(|scope| {
        let (start, started) = std::sync::mpsc::channel::<()>();
        let (done, finished) = std::sync::mpsc::channel::<u64>();
        scope.spawn(move || {
            started.recv().expect("the counting thread starts us");
            let own = allocations_during(|| {
                (0..1000).for_each(|_| drop(black_box(Box::new(black_box(0_u8)))));
            });
            done.send(own).expect("the counting thread waits for us");
        });
        // A channel may allocate on either side. The thousand boxes of the other thread must not count here.
        let mut others = 0;
        let ours = allocations_during(|| {
            start.send(()).expect("the other thread waits for us");
            others = finished.recv().expect("the other thread answers");
        });
        assert_eq!(others, 1000);
        assert!(ours < 100, "{ours} allocations were counted here");
    });
}
