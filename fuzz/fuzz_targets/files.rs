#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| r6_fuzz::files::run(bytes));
