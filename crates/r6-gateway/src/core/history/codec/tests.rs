use proptest::prelude::*;

use super::*;

fn any_time() -> impl Strategy<Value = i64> {
    prop_oneof![3 => 1_700_000_000_000_000_i64..1_700_000_100_000_000, 1 => any::<i64>()]
}

fn any_gap() -> impl Strategy<Value = State> {
    prop::sample::select(Gap::ALL.to_vec()).prop_map(State::Gap)
}

fn any_decimal() -> impl Strategy<Value = State> {
    let printed = (-400_000_000_i64..400_000_000, 0_u8..=9);
    let printed = printed.prop_map(|(number, digits)| unscale(number, digits));
    // All bits: NaN, infinity, both zeros, the smallest numbers.
    prop_oneof![8 => printed, 1 => any::<u64>().prop_map(f64::from_bits)].prop_map(State::Decimal)
}

fn any_integer() -> impl Strategy<Value = State> {
    prop_oneof![3 => -100_i64..100, 1 => any::<i64>()].prop_map(State::Integer)
}

fn any_text() -> impl Strategy<Value = State> {
    prop_oneof![Just(String::new()), "[a-c]{1,2}", "\\PC{0,40}"].prop_map(|text| State::Text(text.into()))
}

fn any_series() -> impl Strategy<Value = Vec<Sample>> {
    let of = |state: BoxedStrategy<State>| {
        let state = prop_oneof![9 => state, 1 => any_gap()];
        let sample = (any_time(), state).prop_map(|(time, state)| Sample { time: Micros(time), state });
        prop::collection::vec(sample, 0..600)
    };
    prop_oneof![of(any_decimal().boxed()), of(any_integer().boxed()), of(any_text().boxed())]
}

fn any_interval() -> impl Strategy<Value = Interval> {
    (1_u32..=3_600_000).prop_map(|millis| Interval::of_millis(millis).unwrap())
}

proptest! {
    #[test]
    fn every_series_comes_back_bit_by_bit(series in any_series(), interval in any_interval()) {
        let (bytes, count) = encode(&mut Times::default(), interval, &series);
        prop_assert_eq!(count, series.len().min(MAX_SAMPLES));
        let decoded = decode(&bytes).unwrap();
        prop_assert_eq!(decoded.interval, interval);
        prop_assert_eq!(&decoded.samples, &series[..count]);
    }

    #[test]
    fn changed_bytes_are_an_error(
        series in any_series(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), 1_u8..), 1..4),
    ) {
        let (bytes, _) = encode(&mut Times::default(), Interval::USUAL, &series);
        let mut changed = bytes.clone();
        for (at, bits) in changes {
            let at = at.index(changed.len());
            changed[at] ^= bits;
        }
        if changed != bytes {
            // One in four thousand million changes of many bytes has the same checksum.
            prop_assert!(decode(&changed).is_err());
        }
    }

    #[test]
    fn no_bytes_with_a_right_checksum_are_a_panic(
        series in any_series(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        cut in any::<prop::sample::Index>(),
        noise in prop::collection::vec(any::<u8>(), 0..40),
    ) {
        let (mut bytes, _) = encode(&mut Times::default(), Interval::USUAL, &series);
        bytes.truncate(bytes.len() - 4);
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        for mut bytes in [bytes[..cut.index(bytes.len())].to_vec(), bytes, [vec![CODEC], noise].concat()] {
            seal(&mut bytes);
            if let Ok(decoded) = decode(&bytes) {
                prop_assert!(decoded.samples.len() <= MAX_SAMPLES);
            }
        }
    }
}

#[test]
fn each_way_to_be_no_chunk_is_told() {
    let sample = |time, state| Sample { time: Micros(time), state };
    let (good, _) = encode(&mut Times::default(), Interval::USUAL, &[sample(5, State::Integer(7))]);
    let with = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = good[..good.len() - 4].to_vec();
        change(&mut bytes);
        seal(&mut bytes);
        decode(&bytes).unwrap_err()
    };
    assert_eq!(decode(&[]), Err(BadChunk::Short));
    assert_eq!(decode(&good[1..]), Err(BadChunk::Checksum));
    assert_eq!(with(&|bytes| bytes[0] = 2), BadChunk::Codec(2));
    assert_eq!(with(&|bytes| bytes.push(0)), BadChunk::Long);
    assert_eq!(with(&|bytes| _ = bytes.pop()), BadChunk::Short);
    assert_eq!(with(&|bytes| bytes.truncate(3)), BadChunk::Short);
    assert_eq!(with(&|bytes| bytes.splice(1..2, [0x81, 0x04]).for_each(drop)), BadChunk::Number, "513");
}

#[test]
fn values_of_two_kinds_go_into_two_chunks() {
    let sample = |time, state| Sample { time: Micros(time), state };
    let series =
        [sample(1, State::Gap(Gap::Stale)), sample(2, State::Integer(1)), sample(3, State::Decimal(1.5))];
    assert_eq!(fitting(&series), 2);
    assert_eq!(encode(&mut Times::default(), Interval::USUAL, &series).1, 2);
}
