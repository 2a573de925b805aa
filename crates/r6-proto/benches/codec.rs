//! Decoding to typed values and encoding from them, compared with serde_json and sonic-rs with typed structs
//! in the same run.
//!
//! Compare the ratios, because times differ between machines. Every case uses 1 024 different frames, and all
//! three must agree on each frame before the timing starts. `r6-bench codec` measures the same in turns, as
//! ratios.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};

#[path = "codec/cases.rs"]
mod cases;
#[path = "codec/others.rs"]
mod others;
#[path = "codec/samples.rs"]
mod samples;

use cases::Case;
use samples::FRAMES;

/// In the same order as in a case.
const CONTENDERS: [&str; 3] = ["r6", "serde_json", "sonic-rs"];

/// The numbers of the frames, repeated without end.
fn turns() -> impl FnMut() -> usize {
    let mut turn = 0;
    move || {
        turn = (turn + 1) % FRAMES;
        turn
    }
}

fn compare(criterion: &mut Criterion, case: Case) {
    let mut group = criterion.benchmark_group(format!("decode {}", case.name));
    group.throughput(Throughput::Elements(1));
    for (contender, mut read) in CONTENDERS.into_iter().zip(case.decode) {
        let mut next = turns();
        group.bench_function(contender, |bencher| bencher.iter(|| black_box(read(next()))));
    }
    group.finish();
    let mut group = criterion.benchmark_group(format!("encode {}", case.name));
    group.throughput(Throughput::Elements(1));
    let mut out = Vec::with_capacity(1 << 16);
    for (contender, mut write) in CONTENDERS.into_iter().zip(case.encode) {
        let mut next = turns();
        group.bench_function(contender, |bencher| {
            bencher.iter(|| {
                out.clear();
                write(next(), &mut out);
                black_box(out.len())
            });
        });
    }
    group.finish();
}

fn codec(criterion: &mut Criterion) {
    for case in cases::all() {
        compare(criterion, case);
    }
}

criterion_group!(benches, codec);
criterion_main!(benches);
