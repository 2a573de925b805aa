use super::*;

fn value(text: &str) -> Node {
    let text = format!("a = {text}");
    let (table, found) = parse(&text);
    assert!(found.wrong.is_empty(), "{:?}", found.wrong);
    table.value("a").cloned().expect("a value")
}

#[test]
fn a_whole_number_is_a_number_with_its_value() {
    assert_eq!((value("-7").number(), value("-7").whole()), (Some(-7.0), Some(-7)));
    assert_eq!((value("0x1F").number(), value("0x1F").whole()), (Some(31.0), Some(31)));
    assert_eq!((value("1_000.5").number(), value("1_000.5").whole()), (Some(1000.5), None));
    for wrong in ["inf", "nan", "-inf", "1e999", "\"1\"", "99999999999999999999"] {
        assert_eq!(value(wrong).number(), None, "{wrong}");
    }
}

#[test]
fn entries_have_the_order_of_the_file() {
    let (table, _) = parse("b = 1\na = 2\n[c]\n");
    let keys: Vec<_> = table.entries.iter().map(|entry| (entry.key.as_str(), entry.at)).collect();
    assert_eq!(keys, [("b", 0), ("a", 6), ("c", 13)]);
}

#[test]
fn a_value_that_is_nested_too_deep_is_of_no_kind() {
    let text = format!("a = {}{}", "[".repeat(MAX_DEPTH + 4), "]".repeat(MAX_DEPTH + 4));
    let (table, found) = parse(&text);
    assert!(found.wrong.is_empty(), "{:?}", found.wrong);
    let mut node = table.value("a").expect("a value");
    let mut depth = 0;
    while let Some(inner) = node.list().and_then(<[Node]>::first) {
        node = inner;
        depth += 1;
    }
    assert!(depth <= MAX_DEPTH && node.value == Value::TooDeep, "{depth}: {node}");
}

#[test]
fn a_hostile_document_is_refused_without_a_panic() {
    let keys = (0..100_000).map(|number| format!("key_{number} = 1\n")).collect::<String>();
    let (table, mut found) = parse(&keys);
    assert_eq!(Fields::of(&table, &["kez"], "").finish(Ok(()), &mut found), None);
    let mistakes = found.finish(Some(())).unwrap_err();
    assert_eq!(mistakes.iter().count() + mistakes.more(), 100_000);
    for text in [
        "=\n".repeat(1_000_000),
        "[".repeat(100_000),
        "a = ".to_owned() + &"[".repeat(100_000),
        "=\n".repeat(10_000),
    ] {
        assert!(parse(&text).1.finish(Some(())).is_err());
    }
}
