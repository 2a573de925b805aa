//! The Chinese pages say what their English twins say: the same code, commands and figures, and no section
//! less. Where such a test fails, change the Chinese page as the English one was changed.

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
            assert_eq!(found, wanted, "{chinese}: code block {number} is another than in {english}");
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
