//! The coverage table of `docs/PROTOCOL.md`: every item of the protocol, and the test that proves it.
//!
//! Below the heading `## Coverage` are one or more tables with the columns `group`, `item`, `manual` and
//! `test`. A test is written `` `crate::file::function` `` and means that function in
//! `crates/crate/tests/file.rs`. A cell may name several tests. Inside a `vectors! { .. }` block of such a
//! file, each line that begins with a name is a test too.

use std::collections::BTreeMap;
use std::fmt;

use crate::workspace;

mod source;

const HEADING: &str = "## Coverage";
const COLUMNS: [&str; 4] = ["group", "item", "manual", "test"];

/// One row of the table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// The family the item belongs to, such as `query` or `command`.
    pub group: String,
    /// The item as the wire spells it, without the backquotes around it.
    pub item: String,
    /// The section of the manual, or other evidence that the item exists.
    pub manual: String,
    /// The tests that prove the item.
    pub tests: Vec<TestName>,
}

/// A test function of an integration test.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct TestName {
    /// The folder of the crate in `crates/`.
    pub package: String,
    /// The file in its `tests/`, without `.rs`.
    pub file: String,
    /// The function.
    pub function: String,
}

impl TestName {
    fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split("::").map(str::to_owned);
        let name = Self { package: parts.next()?, file: parts.next()?, function: parts.next()? };
        let words = [&name.package, &name.file, &name.function];
        (parts.next().is_none() && words.iter().all(|word| is_plain(word))).then_some(name)
    }

    fn path(&self) -> String {
        format!("crates/{}/tests/{}.rs", self.package, self.file)
    }
}

impl fmt::Display for TestName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}::{}::{}", self.package, self.file, self.function)
    }
}

/// Whether it is a plain name of a crate, file or function, which cannot lead to another folder.
fn is_plain(word: &str) -> bool {
    !word.is_empty() && word.chars().all(|symbol| symbol.is_ascii_alphanumeric() || "_-".contains(symbol))
}

/// The rows of the coverage table in `docs/PROTOCOL.md`.
pub fn protocol_rows() -> Vec<Row> {
    let path = workspace::root().join("docs/PROTOCOL.md");
    rows(&workspace::read(&path)).unwrap_or_else(|fault| panic!("{}: {fault}", path.display()))
}

/// The rows of the tables below the heading `## Coverage`, up to the next heading of that level.
///
/// The error names the line that is not a valid row. A table without rows is an error too, because it would
/// prove nothing.
pub fn rows(markdown: &str) -> Result<Vec<Row>, String> {
    let mut lines = markdown.lines().enumerate().skip_while(|(_, line)| line.trim_end() != HEADING);
    lines.next().ok_or_else(|| format!("there is no heading `{HEADING}`"))?;
    let mut rows = Vec::new();
    let mut in_table = false;
    for (index, line) in lines.take_while(|(_, line)| !line.starts_with("# ") && !line.starts_with("## ")) {
        let cells = cells(line);
        let at_line = |fault: String| format!("line {}: {fault}", index + 1);
        match cells {
            None => in_table = false,
            Some(cells) if !in_table => {
                if cells.iter().map(|cell| cell.to_lowercase()).ne(COLUMNS) {
                    return Err(at_line(format!("a table here has the columns {}", COLUMNS.join(", "))));
                }
                in_table = true;
            }
            Some(cells) if cells.iter().all(|cell| is_rule(cell)) => {}
            Some(cells) => rows.push(row(&cells).map_err(at_line)?),
        }
    }
    if rows.is_empty() { Err(format!("no row below `{HEADING}`")) } else { Ok(rows) }
}

/// The cells of a line of a table; `None` for a line outside a table. `\|` is a bar inside a cell.
fn cells(line: &str) -> Option<Vec<String>> {
    let inner = line.trim().strip_prefix('|')?;
    let inner = inner.strip_suffix('|').unwrap_or(inner);
    let joined = inner.replace("\\|", "\0");
    Some(joined.split('|').map(|cell| cell.trim().replace('\0', "|")).collect())
}

/// Whether a cell belongs to the line between a table's head and its rows.
fn is_rule(cell: &str) -> bool {
    cell.contains('-') && cell.chars().all(|symbol| "-:".contains(symbol))
}

fn row(cells: &[String]) -> Result<Row, String> {
    let [group, item, manual, tests] = cells else {
        return Err(format!("{} cells in place of {}", cells.len(), COLUMNS.len()));
    };
    if group.is_empty() || item.is_empty() {
        return Err("a row without group or item".to_owned());
    }
    Ok(Row { group: group.clone(), item: unquoted(item), manual: manual.clone(), tests: test_names(tests)? })
}

/// The text of a cell that is one code span; any other cell stays as it is.
fn unquoted(cell: &str) -> String {
    let inner = cell.strip_prefix('`').and_then(|rest| rest.strip_suffix('`'));
    inner.filter(|inner| !inner.contains('`')).unwrap_or(cell).to_owned()
}

/// Each code span in a cell. The text between the spans must be punctuation.
fn test_names(cell: &str) -> Result<Vec<TestName>, String> {
    if !cell.matches('`').count().is_multiple_of(2) {
        return Err(format!("a backquote is missing in {cell}"));
    }
    let mut names = Vec::new();
    for (index, span) in cell.split('`').enumerate() {
        if index % 2 == 1 {
            names
                .push(TestName::parse(span).ok_or_else(|| format!("`{span}` is not crate::file::function"))?);
        } else if span.chars().any(char::is_alphanumeric) {
            return Err(format!("a test is written between backquotes, unlike {}", span.trim()));
        }
    }
    Ok(names)
}

/// The items of one group, in the order of the table, to compare with the tables of the code.
pub fn items(rows: &[Row], group: &str) -> Vec<String> {
    rows.iter().filter(|row| row.group == group).map(|row| row.item.clone()).collect()
}

/// What is missing for the table: rows without a test, and tests that do not exist.
///
/// A test exists if its file has a function of that name under `#[test]` or `#[tokio::test]` that is not
/// ignored, or the name in a `vectors! { .. }`, `on_every_hand! { .. }` or `for_every_hand! { .. }` block.
pub fn missing_tests(rows: &[Row]) -> Vec<String> {
    let mut sources = BTreeMap::new();
    missing_in(rows, |test| {
        let path = test.path();
        sources
            .entry(path.clone())
            .or_insert_with(|| std::fs::read_to_string(workspace::root().join(path)).ok())
            .clone()
    })
}

fn missing_in(rows: &[Row], mut source_of: impl FnMut(&TestName) -> Option<String>) -> Vec<String> {
    let mut missing = Vec::new();
    for row in rows {
        if row.tests.is_empty() {
            missing.push(format!("{} {}: no test is named", row.group, row.item));
        }
        for test in &row.tests {
            match source_of(test) {
                None => {
                    missing.push(format!("{} {}: {test}: there is no {}", row.group, row.item, test.path()))
                }
                Some(source) if !source::has_test(&source, &test.function) => {
                    missing.push(format!(
                        "{} {}: {test}: no such test in {}",
                        row.group,
                        row.item,
                        test.path()
                    ));
                }
                Some(_) => {}
            }
        }
    }
    missing
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "
# Protocol
| group | item | manual | test |
|---|---|---|---|
| query | not in the section | 1 | |

## Coverage

Words.

| group | item | manual | test |
|:--|---|---|--:|
| query | `version` | 4.1.1 | `r6-proto::query::version`, `r6-proto::vectors::manual_4_1_query` |
| command | `a|b` in words | 4.2 | |

### More

| Group | Item | Manual | Test |
|---|---|---|---|
| query | `axis-n` | 4.1.1 | `r6-controller::queries::axis` |

## After
| group | item | manual | test |
|---|---|---|---|
| query | not in the section | 1 | |
";

    fn page() -> Vec<Row> {
        rows(&PAGE.replace("a|b", "a\\|b")).unwrap()
    }

    fn name(text: &str) -> TestName {
        TestName::parse(text).unwrap()
    }

    #[test]
    fn rows_are_those_of_the_section() {
        let rows = page();
        assert_eq!(items(&rows, "query"), ["version", "axis-n"]);
        assert_eq!(items(&rows, "command"), ["`a|b` in words"]);
        assert_eq!(items(&rows, "photo"), Vec::<String>::new());
        assert_eq!(rows[0].manual, "4.1.1");
        assert_eq!(
            rows[0].tests,
            [name("r6-proto::query::version"), name("r6-proto::vectors::manual_4_1_query")]
        );
        assert_eq!(rows[2].tests[0].path(), "crates/r6-controller/tests/queries.rs");
    }

    #[test]
    fn what_is_no_table_of_tests_is_refused_with_its_line() {
        let fault = |table: &str| rows(&format!("## Coverage\n{table}")).unwrap_err();
        let head = "| group | item | manual | test |\n|---|---|---|---|\n";
        assert!(rows("# Protocol").unwrap_err().contains("no heading"));
        assert!(fault(head).contains("no row"));
        assert!(fault("| group | item | test |").contains("line 2: a table here has the columns"));
        assert!(fault(&format!("{head}| query | `a` | 1 |")).contains("line 4: 3 cells"));
        assert!(fault(&format!("{head}| query | | 1 | |")).contains("without group or item"));
        assert!(
            fault(&format!("{head}| query | `a` | 1 | `a::b` |"))
                .contains("`a::b` is not crate::file::function")
        );
        assert!(fault(&format!("{head}| query | `a` | 1 | `../a::b::c` |")).contains("is not crate::file"));
        assert!(fault(&format!("{head}| query | `a` | 1 | a::b::c |")).contains("between backquotes"));
        assert!(fault(&format!("{head}| query | `a` | 1 | `a::b::c |")).contains("a backquote is missing"));
    }

    #[test]
    fn a_row_without_test_file_or_function_is_missing() {
        let missing = missing_in(&page(), |test| match test.file.as_str() {
            "query" => Some("#[test]\nfn version() {}".to_owned()),
            "vectors" => Some("vectors! {\n  another,\n}".to_owned()),
            _ => None,
        });
        assert_eq!(
            missing,
            [
                "query version: r6-proto::vectors::manual_4_1_query: no such test in crates/r6-proto/tests/vectors.rs",
                "command `a|b` in words: no test is named",
                "query axis-n: r6-controller::queries::axis: there is no crates/r6-controller/tests/queries.rs",
            ]
        );
    }

    #[test]
    fn tests_of_this_crate_are_found_in_their_files() {
        let row = |test| Row {
            group: "g".to_owned(),
            item: "i".to_owned(),
            manual: String::new(),
            tests: vec![name(test)],
        };
        assert_eq!(
            missing_tests(&[row("r6-testkit::layers::every_crate_keeps_to_its_layer")]),
            Vec::<String>::new()
        );
        assert_eq!(
            missing_tests(&[row("r6-testkit::layers::violations")]).len(),
            1,
            "a function that is no test"
        );
        assert_eq!(
            missing_tests(&[row("r6-testkit::nowhere::violations")]).len(),
            1,
            "a file that is not there"
        );
    }
}
