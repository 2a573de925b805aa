//! Calls every function that reads from a message.

use std::sync::LazyLock;

use r6_proto::address::ValueType;
use r6_proto::message::{Action, Body};
use r6_proto::value::{Value, Values};
use r6_proto::{ADDRESSES, Address, Message, Reading};

/// Reads everything that a message offers. No call may panic.
pub fn look_at_everything(message: &Message<'_>) {
    for extra in message.extras() {
        assert!(!extra.to_string().is_empty());
    }
    match &message.body {
        Body::Query(query) => {
            values(query.addresses);
            for (word, address) in query.resolved() {
                match address {
                    // The name of an address gives the same address again.
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
            assert!(!rejection.error.to_string().is_empty() && !rejection.error.path.to_string().is_empty());
        }
        Body::Heartbreak | Body::Photo(_) | Body::PhotoAnswer(_) => {}
    }
}

/// One address for each value type.
static FORMS: LazyLock<Vec<Address>> = LazyLock::new(|| {
    let name = |form| match form {
        ValueType::Text => "version",
        ValueType::Integer => "curAlarm",
        ValueType::Decimal => "axis-0",
        ValueType::Word => "input-0",
        ValueType::Flag => "isMoving",
        ValueType::TextList => "toolCoord",
        ValueType::Counter => "counter-0",
    };
    let mut forms: Vec<Address> = Vec::new();
    for row in &ADDRESSES {
        let address: Address = name(row.value).parse().expect("an address of the table");
        assert_eq!(address.info().value, row.value, "`{address}` is of another form");
        if !forms.contains(&address) {
            forms.push(address);
        }
    }
    forms
});

fn values(values: Values<'_>) {
    for value in values.iter() {
        let (number, integer) = (value.number(), value.integer());
        assert!(number.is_none_or(f64::is_finite));
        // Beyond 2^53 a double cannot represent every whole number.
        if let (Some(number), Some(integer)) = (number, integer)
            && integer.unsigned_abs() < 1 << 53
        {
            #[expect(clippy::cast_precision_loss, reason = "below 2^53 it is exact")]
            let same = number == integer as f64;
            assert!(same, "{number} and {integer}");
        }
        let _ = (value.flag(), value.text(), value.offset(), format!("{value:?}"));
        assert!(value.items().count() <= value.wire().len());
        for address in &*FORMS {
            match Reading::of(*address, value) {
                Ok(reading) => is_read_as(address.info().value, &reading, value),
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
    }
}

/// A reading has the type of its address and agrees with the value.
fn is_read_as(form: ValueType, reading: &Reading, value: Value<'_>) {
    let said = match (form, reading) {
        (ValueType::Text, Reading::Text(text)) => *text == value.text(),
        (ValueType::Integer, Reading::Integer(number)) => Some(*number) == value.integer(),
        (ValueType::Decimal, Reading::Decimal(number)) => Some(*number) == value.number(),
        (ValueType::Word, Reading::Word(word)) => {
            let either = [i64::from(*word), i64::from(word.cast_signed())];
            value.integer().is_some_and(|number| either.contains(&number))
        }
        (ValueType::Flag, Reading::Flag(flag)) => Some(*flag) == value.flag(),
        (ValueType::TextList, Reading::Texts(texts)) => {
            value.items().map(|item| item.text().into_owned()).eq(texts.iter().cloned())
        }
        (ValueType::Counter, Reading::Counter(counter)) if value.is_list() => {
            let items = value.items().map(|item| item.integer());
            items.eq([counter.id, counter.target, counter.current].map(Some))
        }
        // `name[id][T:target][C:current]`
        (ValueType::Counter, Reading::Counter(counter)) => {
            counter.name.as_ref().is_some_and(|name| value.text().starts_with(&format!("{name}[")))
        }
        (_, _) => false,
    };
    assert!(said, "{value:?} is read as {reading:?}");
    let _ = reading.to_string();
}
