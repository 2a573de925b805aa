//! Calls everything that reads from a message.

use r6_proto::message::{Action, Body};
use r6_proto::value::Values;
use r6_proto::{Address, Message, Reading};

/// Looks at all that a message offers; none of it may panic.
pub fn look_at_everything(message: &Message<'_>) {
    for extra in message.extras() {
        assert!(!extra.to_string().is_empty());
    }
    match &message.body {
        Body::Query(query) => {
            values(query.addresses);
            for (word, address) in query.resolved() {
                match address {
                    // What is asked for can be named again.
                    Ok(address) => assert_eq!(address.to_string().parse(), Ok(address), "{word:?}"),
                    Err(error) => assert!(!error.to_string().is_empty()),
                }
            }
        }
        Body::QueryReply(reply) => {
            values(reply.values);
            reply.addresses.into_iter().for_each(values);
            for asked in [0, 1, reply.values.len()] {
                assert_eq!(reply.aligned(asked).is_ok(), asked == reply.values.len());
            }
        }
        Body::Command(words) => {
            values(words.arguments());
            if let Err(error) = words.read() {
                assert!(!error.to_string().is_empty());
            }
        }
        Body::CommandReply(reply) => {
            values(reply.words());
            let _ = (reply.command(), reply.outcome());
        }
        Body::AddRcc(list) => {
            for instruction in list.instructions {
                if let Action::Unknown(unknown) = &instruction.action {
                    for (name, value) in list.unknown_fields(unknown) {
                        let _ = (name.text(), value.text());
                    }
                }
            }
        }
        Body::AddPoints(points) => {
            assert_eq!(points.sets().map(|(_, set)| set.len()).sum::<usize>(), points.len());
        }
        Body::Unknown(unknown) => assert!(!unknown.to_string().is_empty()),
        Body::Rejected(rejection) => {
            assert!(!rejection.error.to_string().is_empty() && !rejection.error.path.is_empty());
        }
        Body::Heartbreak | Body::Photo(_) | Body::PhotoAnswer(_) => {}
    }
}

/// One address of each form a reading can have.
const FORMS: [Address; 3] = [Address::CurMode, Address::CurAlarm, Address::Version];

fn values(values: Values<'_>) {
    for value in values.iter() {
        let (number, integer) = (value.number(), value.integer());
        assert!(number.is_none_or(f64::is_finite));
        // Beyond 2^53 a double no longer tells one whole number from the next.
        if let (Some(number), Some(integer)) = (number, integer)
            && integer.unsigned_abs() < 1 << 53
        {
            #[expect(clippy::cast_precision_loss, reason = "below 2^53 it is exact")]
            let same = number == integer as f64;
            assert!(same, "{number} and {integer}");
        }
        let _ = (value.flag(), value.text(), value.offset(), format!("{value:?}"));
        assert!(value.items().count() <= value.wire().len());
        for address in FORMS {
            let _ = Reading::of(address, value).map(|reading| reading.to_string());
        }
    }
}
