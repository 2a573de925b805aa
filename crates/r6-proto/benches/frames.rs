//! Finding frames in a stream, in pieces of several sizes, compared with the simplest possible loop over the
//! bytes.
//!
//! Compare the ratios to this floor in the same run, because times differ between machines.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use r6_proto::frame::{FrameBuffer, Limits};

#[path = "frames/stream.rs"]
mod stream;

use stream::{FRAMES, byte_loop, in_pieces, stream};

fn frames(criterion: &mut Criterion) {
    let stream = stream();
    let mut buffer = FrameBuffer::new(Limits::default());
    let pieces =
        [("whole", stream.len()), ("pieces of 4096", 4096), ("pieces of 100", 100), ("pieces of 1", 1)];
    let expected = (FRAMES, stream.len());
    assert_eq!(byte_loop(&stream), expected);
    for (name, piece) in pieces {
        assert_eq!(in_pieces(&mut buffer, &stream, piece), expected, "{name}");
    }

    let mut group = criterion.benchmark_group("frames");
    group.throughput(Throughput::Bytes(stream.len() as u64));
    group.bench_function("floor: byte loop", |bencher| bencher.iter(|| byte_loop(black_box(&stream))));
    for (name, piece) in pieces {
        group.bench_function(name, |bencher| {
            bencher.iter(|| in_pieces(&mut buffer, black_box(&stream), piece));
        });
    }
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
