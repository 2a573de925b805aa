//! Tests that docs/PAINS.md has an answer for each of the sixteen pains, and a test named after each.

use std::path::Path;

use r6_testkit::coverage::{self, Row, TestName};

/// The rows of the table: number, pain, answer, tests.
fn table() -> Vec<[String; 4]> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/PAINS.md");
    let page = std::fs::read_to_string(page).unwrap();
    let lines = page.lines().filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |"));
    let cells = |line: &str| -> [String; 4] {
        let cells: Vec<String> = line.split(" | ").map(str::to_owned).collect();
        cells.try_into().unwrap_or_else(|cells| panic!("no four cells: {cells:?}"))
    };
    lines.map(cells).filter(|[number, ..]| number != "#").collect()
}

fn test_names(cell: &str) -> Vec<TestName> {
    let names = cell.split('`').skip(1).step_by(2).map(|name| {
        let parts: Vec<_> = name.split("::").map(str::to_owned).collect();
        let [package, file, function] = parts.try_into().unwrap_or_else(|_| panic!("{name}"));
        TestName { package, file, function }
    });
    names.collect()
}

#[test]
fn the_sixteen_pains_stand_in_their_order_each_with_an_answer() {
    let numbers: Vec<_> = table().iter().map(|[number, ..]| number.clone()).collect();
    assert_eq!(numbers, (1..=16).map(|number: u32| number.to_string()).collect::<Vec<_>>());
    for [number, pain, answer, _] in table() {
        assert!(pain.starts_with("**") && answer.len() > 40 && answer.contains('`'), "{number}");
    }
}

#[test]
fn each_has_a_test_that_exists_and_is_named_after_it() {
    let mut rows = Vec::new();
    for [number, pain, _, tests] in table() {
        let tests = test_names(&tests);
        assert!(!tests.is_empty(), "{number}");
        for test in &tests {
            let start = format!("pain_{:0>2}_", number);
            assert!(test.function.starts_with(&start), "{number}: {test}");
        }
        rows.push(Row { group: "pain".to_owned(), item: pain, manual: number, tests });
    }
    assert_eq!(coverage::missing_tests(&rows), Vec::<String>::new());
}
