//! The Chinese pages say what their English twins say: the same code, commands and figures, and no section
//! less. The comments in the code are Chinese. Where such a test fails, change the Chinese page as the
//! English one was changed.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Component, Path, PathBuf};

use r6_testkit::book;

/// The English pages that have a Chinese twin, and that twin.
const TWINS: [(&str, &str); 4] = [
    ("README.md", "README.zh.md"),
    ("docs/QUICKSTART.md", "docs/zh/QUICKSTART.md"),
    ("docs/SAFETY.md", "docs/zh/SAFETY.md"),
    ("docs/FROM_SOCKETS.md", "docs/zh/FROM_SOCKETS.md"),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// The text of a page of the repository.
fn read(page: &str) -> String {
    fs::read_to_string(root().join(page)).unwrap_or_else(|error| panic!("{page}: {error}"))
}

/// A page in its parts: the code blocks, each with its fences, and the lines outside of them.
fn parts(page: &str) -> (Vec<String>, Vec<&str>) {
    let (mut blocks, mut prose) = (Vec::new(), Vec::new());
    let mut open: Option<String> = None;
    for line in page.lines() {
        let is_fence = line.trim_start().starts_with("```");
        match &mut open {
            Some(block) => {
                *block += &format!("{line}\n");
                if is_fence {
                    blocks.extend(open.take());
                }
            }
            None if is_fence => open = Some(format!("{line}\n")),
            None => prose.push(line),
        }
    }
    assert_eq!(open, None, "a code block does not end");
    (blocks, prose)
}

/// The inline code of a page. Code may stand on two lines, but not in two paragraphs.
fn inline(prose: &[&str]) -> BTreeSet<String> {
    let text = prose.join("\n");
    let codes = text.split("\n\n").flat_map(|paragraph| paragraph.split('`').skip(1).step_by(2));
    codes.map(|code| code.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

/// The figures of a page outside code blocks and the targets of links, such as `50` and `0.378`.
fn figures(prose: &[&str]) -> BTreeSet<String> {
    let mut text = String::new();
    for (number, part) in prose.join("\n").split("](").enumerate() {
        text += if number == 0 { part } else { part.split_once(')').map_or("", |(_, after)| after) };
        text.push(' ');
    }
    let words = text.split(|symbol: char| !symbol.is_ascii_digit() && symbol != '.');
    let words = words.map(|word| word.trim_matches('.')).filter(|word| !word.is_empty());
    words.map(str::to_owned).collect()
}

/// The levels of the headings of a page, in their order.
fn headings(prose: &[&str]) -> Vec<usize> {
    let level = |line: &&str| line.split_once(' ').map(|(marks, _)| marks.to_owned());
    let marks = prose.iter().filter_map(level).filter(|marks| marks.starts_with('#'));
    marks.filter(|marks| marks.chars().all(|mark| mark == '#')).map(|marks| marks.len()).collect()
}

/// The lines of a code block, each as its code and its comment. The documentation of a Python function counts
/// as a comment.
fn lines(block: &str) -> Vec<(&str, Option<&str>)> {
    let mark = if block.trim_start().starts_with("```rust") { "//" } else { "#" };
    let parted = block.lines().map(|line| {
        if line.trim().len() > 6 && line.trim().starts_with("\"\"\"") && line.ends_with("\"\"\"") {
            return ("", Some(line.trim()));
        }
        let is_comment = |at: &usize| {
            let before = &line[..*at];
            before.matches('"').count() % 2 == 0 && (before.is_empty() || before.ends_with(' '))
        };
        let start = line.match_indices(mark).map(|(at, _)| at).find(is_comment);
        start.map_or((line, None), |at| (line[..at].trim_end(), Some(&line[at..])))
    });
    parted.collect()
}

/// The words of a comment that stay as they are in Chinese: those with a figure, a `_`, a `:` or a capital
/// letter behind their first letter.
fn names(comment: &str) -> BTreeSet<&str> {
    let stays =
        |symbol: char| symbol.is_ascii_digit() || symbol.is_ascii_uppercase() || "_:".contains(symbol);
    let words = comment.split(|symbol: char| !symbol.is_ascii_alphanumeric() && !"_:.".contains(symbol));
    let words = words.map(|word| word.trim_matches(['.', ':']));
    words
        .filter(|word| {
            word.starts_with(|first: char| first.is_ascii_digit()) || word.chars().skip(1).any(stays)
        })
        .collect()
}

/// Whether a comment has a word that is not a name.
fn has_words(comment: &str) -> bool {
    let names = names(comment);
    let mut words = comment.split(|symbol: char| !symbol.is_ascii_alphanumeric() && !"_:.".contains(symbol));
    words.any(|word| word.len() > 1 && !names.contains(word.trim_matches(['.', ':'])))
}

/// How a code block differs from its twin.
fn difference(wanted: &str, found: &str) -> Option<String> {
    let (wanted, found) = (lines(wanted), lines(found));
    let code =
        |lines: &[(&str, Option<&str>)]| lines.iter().map(|(code, _)| (*code).to_owned()).collect::<Vec<_>>();
    if code(&wanted) != code(&found) {
        return Some(format!("the code is {:#?}, and should be {:#?}", code(&found), code(&wanted)));
    }
    wanted.iter().zip(&found).find_map(|((_, wanted), (_, found))| match (wanted, found) {
        (None, None) => None,
        (Some(wanted), Some(found)) if names(wanted) != names(found) => {
            Some(format!("`{found}` has other names or figures than `{wanted}`"))
        }
        (Some(wanted), Some(found)) if has_words(wanted) && !found.contains(is_chinese) => {
            Some(format!("`{found}` is not Chinese"))
        }
        (Some(_), Some(_)) => None,
        (wanted, found) => Some(format!("the comment {wanted:?} has become {found:?}")),
    })
}

fn is_chinese(symbol: char) -> bool {
    ('\u{4e00}'..='\u{9fff}').contains(&symbol)
}

/// The path of `page` as a link on `from`.
fn link(from: &str, page: &str) -> String {
    let up = Path::new(from).parent().unwrap().components().count();
    let (page, folder) = (Path::new(page), Path::new(from).parent().unwrap());
    match page.strip_prefix(folder) {
        Ok(below) => below.display().to_string(),
        Err(_) => {
            let shared = page.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
            let rest: PathBuf = page.components().skip(shared).map(Component::as_os_str).collect();
            format!("{}{}", "../".repeat(up - shared), rest.display())
        }
    }
}

#[test]
fn every_code_block_is_that_of_the_english_page() {
    for (english, chinese) in TWINS {
        let (wanted, found) = (parts(&read(english)).0, parts(&read(chinese)).0);
        for (number, (wanted, found)) in (1..).zip(wanted.iter().zip(&found)) {
            let different = difference(wanted, found);
            assert_eq!(different, None, "{chinese}: code block {number} is another than in {english}");
        }
        assert_eq!(found.len(), wanted.len(), "{chinese}: code blocks");
    }
}

/// Not commands alone: a name that is missing is a fact that is missing.
#[test]
fn every_command_and_name_is_on_both_pages() {
    for (english, chinese) in TWINS {
        let (wanted, found) = (read(english), read(chinese));
        let (wanted, found) = (inline(&parts(&wanted).1), inline(&parts(&found).1));
        let missing: Vec<_> = wanted.difference(&found).collect();
        let strange: Vec<_> = found.difference(&wanted).collect();
        assert!(missing.is_empty(), "{chinese} has not this inline code of {english}: {missing:?}");
        assert!(strange.is_empty(), "{chinese} has inline code that {english} has not: {strange:?}");
    }
}

#[test]
fn every_figure_is_on_both_pages() {
    for (english, chinese) in TWINS {
        let (wanted, found) = (read(english), read(chinese));
        let (wanted, found) = (figures(&parts(&wanted).1), figures(&parts(&found).1));
        let missing: Vec<_> = wanted.difference(&found).collect();
        let strange: Vec<_> = found.difference(&wanted).collect();
        assert!(missing.is_empty(), "{chinese} has not these figures of {english}: {missing:?}");
        assert!(strange.is_empty(), "{chinese} has figures that {english} has not: {strange:?}");
    }
}

#[test]
fn no_page_has_a_section_less() {
    for (english, chinese) in TWINS {
        let (wanted, found) = (read(english), read(chinese));
        let (wanted, found) = (headings(&parts(&wanted).1), headings(&parts(&found).1));
        assert!(wanted.len() > 1, "{english} has no sections");
        assert_eq!(found, wanted, "{chinese}: levels of the headings, beside {english}");
    }
}

#[test]
fn every_chinese_page_has_an_english_twin() {
    let mut pages = vec!["README.zh.md".to_owned()];
    for entry in fs::read_dir(root().join("docs/zh")).unwrap() {
        pages.push(format!("docs/zh/{}", entry.unwrap().file_name().into_string().unwrap()));
    }
    let twins: BTreeSet<_> = TWINS.iter().map(|(_, chinese)| (*chinese).to_owned()).collect();
    assert_eq!(pages.into_iter().collect::<BTreeSet<_>>(), twins);
}

#[test]
fn each_page_leads_to_the_other_language_at_its_top() {
    for (english, chinese) in TWINS {
        for (page, other, name) in [(english, chinese, "简体中文"), (chinese, english, "English")] {
            let wanted = format!("[{name}]({})", link(page, other));
            let text = read(page);
            let second = text.lines().skip(1).find(|line| !line.is_empty());
            assert_eq!(second, Some(wanted.as_str()), "{page}: the line below its title");
        }
    }
}

/// A Chinese page leads to Chinese pages where there are some.
#[test]
fn links_stay_in_the_language() {
    for (english, chinese) in TWINS {
        let text = read(chinese);
        let prose = parts(&text).1.join("\n");
        for (other, _) in TWINS.into_iter().filter(|(other, _)| *other != english) {
            let strange = format!("]({}", link(chinese, other));
            assert!(!prose.contains(&strange), "{chinese} links to {other}, which is there in Chinese");
        }
    }
}

#[test]
fn every_link_leads_somewhere() {
    let is_chinese =
        |dead: &String| TWINS.iter().any(|(_, chinese)| dead.starts_with(&format!("{chinese}:")));
    let dead: Vec<_> = book::dead_links().into_iter().filter(is_chinese).collect();
    assert_eq!(dead, Vec::<String>::new());
}

#[test]
fn a_block_is_compared_without_the_words_of_its_comments() {
    let english = "```console\n$ r6 run a.toml --wait   # within limits, then r6 command startButton\n```\n";
    let chinese = "```console\n$ r6 run a.toml --wait   # 检查限值，再 r6 command startButton\n```\n";
    assert_eq!(difference(english, chinese), None);
    for (from, to) in [
        ("--wait", "--wai"),
        ("--wait   ", "--wait 5   "),
        ("$ r6 run", "$ r6  run"),
        ("startButton", "stopButton"),
        ("# 检查", "检查"),
        ("   # 检查限值，再 r6 command startButton", ""),
        ("检查限值，再", "within limits, then"),
    ] {
        assert!(chinese.contains(from));
        assert_ne!(difference(english, &chinese.replace(from, to)), None, "{from} -> {to}");
    }

    let rust = "```rust\n/// Says why.\nlet a = \"x // y\"; // 0 to 9\n```\n";
    assert_eq!(lines(rust)[1..3], [("", Some("/// Says why.")), ("let a = \"x // y\";", Some("// 0 to 9"))]);
    assert_eq!(difference(rust, &rust.replace("Says why", "说明原因").replace("to", "至")), None);
    assert_ne!(difference(rust, &rust.replace("Says why", "说明原因").replace("0 to 9", "0 至 8")), None);
    assert_ne!(difference(rust, &rust.replace("x // y", "x // z")), None);

    let python = "```python\n    \"\"\"Says why.\"\"\"\n    send(a)  # 1\n```\n";
    assert_eq!(difference(python, &python.replace("Says why.", "说明原因。")), None);
    assert_ne!(difference(python, &python.replace("# 1", "# 2")), None);
    assert_ne!(difference(python, python), None, "an English comment");
}

#[test]
fn a_page_is_taken_apart() {
    let page = "# T\n[x](y-7.md) `a\nb` 3.5 mm, 10.\n```sh\n`no` 99 # no\n```\n## S\n#5 `c`\n";
    let (blocks, prose) = parts(page);
    assert_eq!(blocks, ["```sh\n`no` 99 # no\n```\n"]);
    assert_eq!(inline(&prose).into_iter().collect::<Vec<_>>(), ["a b", "c"]);
    assert_eq!(figures(&prose).into_iter().collect::<Vec<_>>(), ["10", "3.5", "5"]);
    assert_eq!(headings(&prose), [1, 2]);
    assert_eq!(link("docs/A.md", "docs/zh/A.md"), "zh/A.md");
    assert_eq!(link("docs/zh/A.md", "docs/A.md"), "../A.md");
    assert_eq!(link("README.zh.md", "README.md"), "README.md");
}
