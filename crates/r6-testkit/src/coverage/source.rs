//! Finds tests in the text of a Rust file.

/// The macros that make a test from each line.
const LISTS: [&str; 3] = ["vectors! {", "on_every_hand! {", "for_every_hand! {"];

/// Whether `source` has a test called `function`, as a function or as a line of one of the [`LISTS`].
pub(super) fn has_test(source: &str, function: &str) -> bool {
    has_test_function(source, function) || names_in_lists(source).contains(&function)
}

fn has_test_function(source: &str, function: &str) -> bool {
    let lines: Vec<&str> = source.lines().map(str::trim).collect();
    lines.iter().enumerate().any(|(index, line)| {
        let head = line.strip_prefix("pub ").unwrap_or(line);
        let head = head.strip_prefix("async ").unwrap_or(head);
        let name = head.strip_prefix("fn ").and_then(|rest| rest.strip_prefix(function));
        name.is_some_and(|rest| rest.starts_with(['(', '<'])) && is_marked_as_test(&lines[..index])
    })
}

/// Whether the attributes directly above a function, at the end of `lines`, make it a test that runs.
fn is_marked_as_test(lines: &[&str]) -> bool {
    let attributes =
        || lines.iter().rev().take_while(|line| line.starts_with("#[") || line.starts_with("///"));
    attributes().any(|line| *line == "#[test]" || line.starts_with("#[tokio::test"))
        && !attributes().any(|line| line.starts_with("#[ignore"))
}

/// The first word of each line inside the [`LISTS`].
fn names_in_lists(source: &str) -> Vec<&str> {
    let mut names = Vec::new();
    let mut depth = 0_i64;
    for line in source.lines().map(str::trim).filter(|line| !line.starts_with("//")) {
        if depth > 0 {
            let end = line
                .find(|symbol: char| !symbol.is_ascii_alphanumeric() && symbol != '_')
                .unwrap_or(line.len());
            names.extend(Some(&line[..end]).filter(|name| !name.is_empty()));
        } else if !LISTS.iter().any(|list| line.starts_with(list)) {
            continue;
        }
        let braces = |brace| i64::try_from(line.matches(brace).count()).unwrap_or(i64::MAX);
        depth += braces('{') - braces('}');
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_test_is_a_function_below_its_attribute() {
        let found = |source: &str| has_test(source, "stop");
        assert!(found("#[test]\nfn stop() {}"));
        assert!(found("    #[tokio::test(start_paused = true)]\n    /// Words.\n    async fn stop() {}"));
        assert!(found("#[test]\n#[should_panic]\nfn stop() {}"));
        assert!(found("proptest! {\n  #[test]\n  fn stop(bytes: Vec<u8>) {}\n}"));
        assert!(!found("fn stop() {}"));
        assert!(!found("#[test]\n\nfn stop() {}"), "the attribute belongs directly above");
        assert!(!found("#[test]\nfn stop_twice() {}"));
        assert!(!found("#[test]\n// fn stop() {}"));
        assert!(!found("#[test]\n#[ignore]\nfn stop() {}"), "an ignored test proves nothing");
        assert!(!found("#[test]\nfn go() { stop() }\nfn stop() {}"));
    }

    #[test]
    fn a_vector_list_names_one_test_a_line() {
        let source = "macro_rules! vectors {\n  outside => {}\n}\nvectors! {\n  plain,\n  // comment,\n  nested => {\n    \
                      inner,\n  }\n  last: \"x\"\n}\nafter,\n";
        assert_eq!(names_in_lists(source), ["plain", "nested", "inner", "last"]);
        assert!(has_test(source, "plain") && !has_test(source, "after") && !has_test(source, "comment"));
    }

    #[test]
    fn a_list_of_every_hand_names_one_test_a_line() {
        let source =
            "on_every_hand! {\n  stop,\n}\non_every_hand! { in Real:\n  go,\n}\nasync fn wait() {}\n";
        assert_eq!(names_in_lists(source), ["stop", "go"]);
        assert!(!has_test(source, "wait"));
    }
}
