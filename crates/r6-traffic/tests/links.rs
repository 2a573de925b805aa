//! Tests of the faults of a link, without sockets: frames arrive complete and in order or not at all, as the
//! fault requires, and the same seed gives the same result.

use std::time::Duration;

use proptest::prelude::*;
use r6_proto::time::Instant;
use r6_traffic::fault::{LinkFault, LinkFaultNow};
use r6_traffic::link::{Delivery, Link, MAX_WAITING_BYTES, MAX_WAITING_PARCELS};

const START: Instant = Instant::from_nanos(1_000_000_000_000);

fn always(fault: LinkFault) -> LinkFaultNow {
    LinkFaultNow { fault, chance: 1.0 }
}

fn with(faults: &[LinkFault]) -> Link {
    let faults: Vec<_> = faults.iter().copied().map(always).collect();
    Link::new(1, START, &faults)
}

fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

/// Everything that leaves for the client from `now` on, with its time, until nothing is in transit.
fn drain(link: &mut Link, mut now: Instant) -> Vec<(Instant, Delivery)> {
    let mut delivered = Vec::new();
    loop {
        while let Some(delivery) = link.poll_to_client(now) {
            delivered.push((now, delivery));
        }
        match link.next_due() {
            Some(due) => {
                assert!(due > now, "what is due was handed over");
                now = due;
            }
            None => return delivered,
        }
    }
}

fn bytes_of(delivered: &[(Instant, Delivery)]) -> Vec<u8> {
    let pieces = delivered.iter().filter_map(|(_, delivery)| match delivery {
        Delivery::Bytes(bytes) => Some(bytes.as_slice()),
        Delivery::Close | Delivery::Reset => None,
    });
    pieces.collect::<Vec<_>>().concat()
}

/// Frames of random bytes, each with the pause before it in ns.
fn frames() -> impl Strategy<Value = Vec<(u64, Vec<u8>)>> {
    prop::collection::vec((0..30_000_000_u64, prop::collection::vec(any::<u8>(), 1..300)), 1..30)
}

/// The most frames that a fault of [`harmless`] gathers.
const MOST_GATHERED: usize = 5;

/// Faults that lose nothing.
fn harmless() -> impl Strategy<Value = Vec<LinkFaultNow>> {
    let time = || (0..80_u64).prop_map(ms);
    let fault = prop_oneof![
        (1..50_usize).prop_map(|bytes| LinkFault::Pieces { bytes }),
        (2..=MOST_GATHERED, time()).prop_map(|(frames, within)| LinkFault::Coalesce { frames, within }),
        (time(), time(), time()).prop_map(|(to_controller, to_client, spread)| LinkFault::Latency {
            to_controller,
            to_client,
            spread
        }),
        (1..100_000_u32).prop_map(|bytes_per_second| LinkFault::Slow { bytes_per_second }),
        time().prop_map(|delay| LinkFault::Stall { delay }),
    ];
    let now =
        (fault, prop_oneof![Just(1.0), 0.0..1.0]).prop_map(|(fault, chance)| LinkFaultNow { fault, chance });
    prop::collection::vec(now, 0..5)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    #[test]
    fn without_faults_whatever_is_given_is_handed_on_at_once(frames in frames()) {
        let mut link = Link::new(3, START, &[]);
        for (_, frame) in frames {
            prop_assert!(link.is_transparent());
            prop_assert!(link.send(START, &frame));
            prop_assert_eq!(link.poll_to_client(START), Some(Delivery::Bytes(frame.clone())));
            prop_assert_eq!(link.receive(START, &frame), frame.len());
            prop_assert_eq!(link.poll_to_controller(START), Some(frame));
            prop_assert_eq!(link.next_due(), None);
        }
    }

    #[test]
    fn bytes_come_through_whole_and_in_order(
        frames in frames(), begin in harmless(), then in harmless(), change in 0..30_usize, seed: u64,
    ) {
        let mut link = Link::new(seed, START, &begin);
        let mut now = START;
        let (mut to_client, mut at_client) = (Vec::new(), Vec::new());
        let (mut to_controller, mut at_controller) = (Vec::new(), Vec::new());
        for (nth, (pause, frame)) in frames.iter().enumerate() {
            now += Duration::from_nanos(*pause);
            if nth == change {
                link.set_faults(now, &then);
            }
            if link.send(now, frame) {
                to_client.extend_from_slice(frame);
            }
            let taken = link.receive(now, frame);
            to_controller.extend_from_slice(&frame[..taken]);
            if nth % 3 == 0 {
                while let Some(Delivery::Bytes(bytes)) = link.poll_to_client(now) {
                    at_client.extend(bytes);
                }
                while let Some(bytes) = link.poll_to_controller(now) {
                    at_controller.extend(bytes);
                }
            }
        }
        loop {
            while let Some(delivery) = link.poll_to_client(now) {
                let Delivery::Bytes(bytes) = delivery else { panic!("nothing ends it") };
                prop_assert!(!bytes.is_empty());
                at_client.extend(bytes);
            }
            while let Some(bytes) = link.poll_to_controller(now) {
                at_controller.extend(bytes);
            }
            let Some(due) = link.next_due() else { break };
            prop_assert!(due > now);
            now = due;
        }
        prop_assert!(link.is_idle());
        prop_assert_eq!(at_client, to_client);
        prop_assert_eq!(at_controller, to_controller);
    }

    #[test]
    fn a_seed_says_what_is_delivered(frames in frames(), faults in harmless(), seed: u64, noise in 0.0..0.5_f64) {
        let faults: Vec<_> =
            faults.into_iter().chain([LinkFaultNow { fault: LinkFault::Noise, chance: noise }]).collect();
        let run = |looks_at_the_other_way: bool| {
            let mut link = Link::new(seed, START, &faults);
            let mut now = START;
            for (pause, frame) in &frames {
                now += Duration::from_nanos(*pause);
                let _ = link.send(now, frame);
                if looks_at_the_other_way {
                    let _ = link.receive(now, frame);
                    while link.poll_to_controller(now).is_some() {}
                }
            }
            let mut delivered = Vec::new();
            for _ in 0..100_000 {
                now += ms(1);
                while let Some(delivery) = link.poll_to_client(now) {
                    delivered.push((now, delivery));
                }
                if link.is_idle() {
                    break;
                }
                while link.poll_to_controller(now).is_some() {}
            }
            delivered
        };
        let once = run(false);
        prop_assert_eq!(&once, &run(false));
        prop_assert_eq!(bytes_of(&once), bytes_of(&run(true)), "one direction does not depend on the other");
    }

    #[test]
    fn a_reset_leaves_a_strict_part_of_the_frame(
        frame in prop::collection::vec(any::<u8>(), 1..300), after in prop::option::of(0..400_usize), seed: u64,
        others in harmless(),
    ) {
        let reset = always(LinkFault::ResetMidFrame { after });
        let faults: Vec<_> = others.into_iter().chain([reset]).collect();
        let mut link = Link::new(seed, START, &faults);
        prop_assert!(link.send(START, &frame));
        prop_assert!(link.send(START, b"what nobody gets"));
        let delivered = drain(&mut link, START);
        let came = bytes_of(&delivered);
        prop_assert!(came.len() < frame.len() && frame.starts_with(&came));
        if let Some(after) = after {
            prop_assert_eq!(came.len(), after.min(frame.len() - 1));
        } else if frame.len() > 1 {
            prop_assert!(!came.is_empty());
        }
        let ends = delivered.iter().filter(|(_, delivery)| *delivery == Delivery::Reset).count();
        prop_assert_eq!((ends, &delivered.last().unwrap().1), (1, &Delivery::Reset));
        prop_assert!(link.send(START, &frame) && link.is_idle());
        prop_assert_eq!((link.receive(START, &frame), link.poll_to_controller(START)), (frame.len(), None));
    }

    #[test]
    fn no_more_waits_than_the_limit(seed: u64, faults in harmless(), length in 1..5000_usize) {
        fill(&mut Link::new(seed, START, &faults), length);
    }
}

/// Sends frames of this length, in both directions, until the link takes no more.
fn fill(link: &mut Link, length: usize) {
    let frame = vec![7; length];
    // The limit is on bytes or on parcels. A parcel can hold the maximum number of gathered frames.
    let enough = MAX_WAITING_PARCELS * MOST_GATHERED + 1;
    let sent = length * (0..enough).take_while(|_| link.send(START, &frame)).count();
    let received: usize =
        (0..enough).map(|_| link.receive(START, &frame)).take_while(|taken| *taken > 0).sum();
    assert!(sent <= MAX_WAITING_BYTES + length && received <= MAX_WAITING_BYTES);
    assert!(!link.send(START, &frame) && link.room() == 0);
}

#[test]
fn single_bytes_fill_it_however_they_are_gathered() {
    fill(&mut with(&[LinkFault::Coalesce { frames: MOST_GATHERED, within: ms(1) }]), 1);
}

#[test]
fn a_frame_of_any_length_is_taken_whole() {
    let mut link = with(&[LinkFault::Slow { bytes_per_second: 1 }]);
    assert!(link.send(START, &vec![b'x'; 2 * MAX_WAITING_BYTES]), "a link that is empty takes any frame");
    assert!(!link.send(START, b"{}"), "and then nothing more");
}

#[test]
fn an_orderly_end_comes_in_the_place_of_a_frame() {
    let mut link = with(&[LinkFault::CloseBeforeReply, LinkFault::ResetMidFrame { after: None }]);
    assert!(link.send(START, b"{}"));
    assert_eq!(drain(&mut link, START), [(START, Delivery::Close)]);
}

#[test]
fn half_open_makes_deaf_what_is_there_and_for_ever() {
    let half_open = [always(LinkFault::HalfOpen)];
    let mut link = Link::new(1, START, &[]);
    assert!(link.send(START, b"on its way"));
    link.set_faults(START, &half_open);
    link.set_faults(START, &[]);
    assert!(link.is_deaf() && !link.notices_end() && !link.is_transparent());
    assert!(link.send(START, b"{}") && link.receive(START, b"{}") == 2);
    assert_eq!((link.poll_to_client(START), link.poll_to_controller(START)), (None, None));
    // A connection made while the fault is in force is not struck, whatever else begins and ends.
    let mut link = Link::new(1, START, &half_open);
    link.set_faults(START, &[half_open[0], always(LinkFault::BlackHole)]);
    assert!(link.is_transparent());
    link.set_faults(START, &[]);
    link.set_faults(START, &half_open);
    assert!(link.is_deaf(), "a second time is another fault");
}

#[test]
fn silence_makes_deaf_what_comes() {
    let silence = [always(LinkFault::Silence)];
    let mut link = Link::new(1, START, &silence);
    link.set_faults(START, &[]);
    assert!(link.is_deaf() && link.notices_end());
    let mut link = Link::new(1, START, &[]);
    link.set_faults(START, &silence);
    assert!(link.is_transparent());
}

#[test]
fn a_chance_of_a_connection_is_drawn_once() {
    let faults = [LinkFaultNow { fault: LinkFault::Silence, chance: 0.3 }];
    let deaf = (0..1000).filter(|seed| Link::new(*seed, START, &faults).is_deaf()).count();
    assert!((250..350).contains(&deaf), "{deaf}");
    let half_open = LinkFaultNow { fault: LinkFault::HalfOpen, chance: 0.3 };
    let deaf = (0..1000).filter(|seed| {
        let mut link = Link::new(*seed, START, &[]);
        for other in [LinkFault::Noise, LinkFault::Refuse, LinkFault::BlackHole] {
            link.set_faults(START, &[always(other), half_open]);
        }
        link.is_deaf()
    });
    assert!((250..350).contains(&deaf.count()));
}

/// The reported strikes after a frame and a read.
fn told(link: &mut Link) -> Vec<LinkFault> {
    assert!(link.send(START, b"abcdefgh"));
    assert_eq!(link.receive(START, b"abc"), 3);
    std::iter::from_fn(|| link.poll_strike()).collect()
}

#[test]
fn each_fault_that_strikes_is_told_once_and_no_other_is() {
    for fault in [
        LinkFault::ResetMidFrame { after: Some(2) },
        LinkFault::CloseBeforeReply,
        LinkFault::Pieces { bytes: 3 },
        LinkFault::Coalesce { frames: 2, within: ms(40) },
        LinkFault::Latency { to_controller: ms(1), to_client: ms(1), spread: ms(0) },
        LinkFault::Slow { bytes_per_second: 1000 },
        LinkFault::Noise,
        LinkFault::Stall { delay: ms(190) },
        LinkFault::Silence,
    ] {
        let mut link = with(&[fault]);
        assert_eq!((told(&mut link), told(&mut link)), (vec![fault], vec![]));
        let mut spared = Link::new(1, START, &[LinkFaultNow { fault, chance: 0.0 }]);
        assert_eq!(told(&mut spared), []);
    }
    let mut link = Link::new(1, START, &[]);
    link.set_faults(START, &[always(LinkFault::HalfOpen), always(LinkFault::Silence)]);
    assert_eq!(told(&mut link), [LinkFault::HalfOpen]);
}

#[test]
fn a_fault_of_which_nothing_was_felt_is_not_told() {
    let slow = LinkFault::Slow { bytes_per_second: 1000 };
    assert_eq!(with(&[slow, LinkFault::Noise, LinkFault::CloseBeforeReply]).poll_strike(), None);
    // The link is deaf already, so nothing else can be struck.
    let mut link = with(&[LinkFault::Silence, LinkFault::CloseBeforeReply]);
    assert_eq!(told(&mut link), [LinkFault::Silence]);
}

#[test]
fn pieces_are_as_long_as_they_should_be() {
    let mut link = with(&[LinkFault::Pieces { bytes: 3 }, LinkFault::Pieces { bytes: 4 }]);
    assert!(link.send(START, b"abcdefgh"));
    let pieces: Vec<_> = drain(&mut link, START).into_iter().map(|(_, piece)| piece).collect();
    assert_eq!(pieces, ["abc", "def", "gh"].map(|piece| Delivery::Bytes(piece.into())));
}

#[test]
fn frames_are_gathered_until_there_are_enough_or_it_is_time() {
    let mut link = with(&[LinkFault::Coalesce { frames: 3, within: ms(40) }]);
    let piece = |text: &str| Some(Delivery::Bytes(text.into()));
    for frame in ["a", "b"] {
        assert!(link.send(START, frame.as_bytes()));
        assert_eq!(link.poll_to_client(START), None);
    }
    assert!(link.send(START + ms(1), b"c") && link.send(START + ms(1), b"d"));
    assert_eq!(link.poll_to_client(START + ms(1)), piece("abc"));
    assert!(link.send(START + ms(2), b"e"), "the rest of a group whose first ones are gone");
    assert_eq!(link.next_due(), Some(START + ms(41)));
    assert_eq!(link.poll_to_client(START + ms(41)), piece("de"));
    assert!(link.send(START + ms(50), b"f"));
    link.set_faults(START + ms(51), &[]);
    assert_eq!(link.poll_to_client(START + ms(51)), piece("f"), "it does not wait for a fault that is over");
}

#[test]
fn a_stalled_frame_comes_in_two_halves() {
    let mut link = with(&[LinkFault::Stall { delay: ms(190) }]);
    assert!(link.send(START, b"abcd"));
    let half = |text: &str| Delivery::Bytes(text.into());
    assert_eq!(drain(&mut link, START), [(START, half("ab")), (START + ms(190), half("cd"))]);
}

#[test]
fn latency_lies_between_its_ends_and_keeps_the_order() {
    let latency = LinkFault::Latency { to_controller: ms(10), to_client: ms(100), spread: ms(50) };
    let mut seen = Vec::new();
    for seed in 0..300 {
        let mut link = Link::new(seed, START, &[always(latency)]);
        assert!(link.send(START, b"a") && link.send(START, b"b") && link.receive(START, b"c") == 1);
        let towards = link.next_due().unwrap();
        assert!((START + ms(10)..=START + ms(60)).contains(&towards));
        assert_eq!(link.poll_to_controller(towards), Some(b"c".to_vec()));
        let delivered = drain(&mut link, START);
        assert_eq!(bytes_of(&delivered), b"ab");
        assert!((START + ms(100)..=START + ms(150)).contains(&delivered[0].0));
        seen.push(delivered[0].0.since(START));
    }
    seen.sort_unstable();
    assert!(seen[0] < ms(105) && seen[299] > ms(145));
}

#[test]
fn a_slow_line_carries_what_it_should_both_ways() {
    for bytes_per_second in [1, 100, 20_000] {
        let mut link = with(&[LinkFault::Slow { bytes_per_second }]);
        let frame = vec![b'x'; usize::try_from(bytes_per_second).unwrap() * 3];
        assert!(link.send(START, &frame));
        let mut given = link.receive(START, &frame);
        assert_eq!(given, usize::try_from(bytes_per_second).unwrap(), "no more than it carries in a second");
        let (mut now, mut arrived) = (START, 0);
        let (mut last_client, mut last_controller) = (START, START);
        while let Some(due) = link.next_due() {
            now = now.max(due);
            while link.poll_to_client(now).is_some() {
                last_client = now;
            }
            while let Some(bytes) = link.poll_to_controller(now) {
                arrived += bytes.len();
                last_controller = now;
            }
            given += link.receive(now, &frame[given..]);
        }
        assert_eq!(arrived, frame.len());
        for last in [last_client, last_controller] {
            assert!((1.9..=3.0).contains(&last.since(START).as_secs_f64()), "{bytes_per_second}: {last}");
        }
    }
    let mut link = with(&[LinkFault::Slow { bytes_per_second: 1 }]);
    assert!(link.send(START, b"abc"));
    assert_eq!(link.poll_to_client(START), Some(Delivery::Bytes(b"a".to_vec())));
    link.set_faults(START + ms(1), &[]);
    assert_eq!(link.poll_to_client(START + ms(1)), Some(Delivery::Bytes(b"bc".to_vec())), "it is fast again");
}

#[test]
fn noise_strikes_as_many_bytes_as_it_should_and_in_three_ways() {
    let length = 50_000;
    for chance in [0.0, 0.001, 0.02, 0.5] {
        let mut link = Link::new(9, START, &[LinkFaultNow { fault: LinkFault::Noise, chance }]);
        let sent: Vec<u8> = (0..length).map(|n: u32| n.to_le_bytes()[0]).collect();
        // Each frame has one byte, so the effect on it is visible.
        let (mut changed, mut lost, mut followed) = (0, 0, 0);
        for byte in &sent {
            assert!(link.send(START, &[*byte]));
            match bytes_of(&drain(&mut link, START)).as_slice() {
                [] => lost += 1,
                [same] if same == byte => {}
                [_] => changed += 1,
                [same, _] => {
                    assert_eq!(same, byte);
                    followed += 1;
                }
                more => panic!("{more:?}"),
            }
        }
        let expected = f64::from(length) * chance / 3.0;
        for count in [changed, lost, followed] {
            let off = (f64::from(count) - expected).abs();
            assert!(off <= 4.0 * expected.sqrt(), "{chance}: {count}, expected {expected}");
        }
    }
}
