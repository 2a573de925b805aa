//! Checks the pages of the repository: their links, their headings, and the chapters of the book in `docs/`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use crate::workspace;

/// The pages of the book and those at the root.
fn pages() -> Vec<PathBuf> {
    let root = workspace::root();
    let mut pages = workspace::files(&root.join("docs"), "md");
    let at_root =
        ["README.md", "README.zh.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md"];
    pages.extend(at_root.map(|page| root.join(page)));
    pages
}

/// Links that lead nowhere: to a missing file, or to a heading that the page does not have. Each is written
/// `page: target`. Links to other sites are not checked.
pub fn dead_links() -> Vec<String> {
    let root = workspace::root();
    let mut headings: BTreeMap<PathBuf, BTreeSet<String>> = BTreeMap::new();
    let mut dead = Vec::new();
    for page in pages() {
        let text = workspace::read(&page);
        for target in links(&text) {
            let (file, anchor) = target.split_once('#').unwrap_or((&target, ""));
            let path = match file {
                "" => page.clone(),
                file => plain(&page.parent().unwrap_or(&root).join(file)),
            };
            let is_there = path.exists()
                && (anchor.is_empty() || {
                    let known =
                        headings.entry(path.clone()).or_insert_with(|| anchors(&workspace::read(&path)));
                    known.contains(anchor)
                });
            if !is_there {
                let page = page.strip_prefix(&root).unwrap_or(&page);
                dead.push(format!("{}: {target}", page.display()));
            }
        }
    }
    dead
}

/// Pages of `docs/` that are not exactly one chapter of the book.
pub fn pages_out_of_the_book() -> Vec<String> {
    let docs = workspace::root().join("docs");
    let summary = links(&workspace::read(&docs.join("SUMMARY.md")));
    let chapters = |name: &str| summary.iter().filter(|chapter| *chapter == name).count();
    let pages = workspace::files(&docs, "md").into_iter().filter_map(|page| {
        let name = page.strip_prefix(&docs).ok()?.to_str()?.to_owned();
        (name != "SUMMARY.md" && chapters(&name) != 1).then_some(name)
    });
    pages.collect()
}

/// The figures of the README, rows `| what | against | ratio |` below its heading `## How fast`, that differ
/// from `docs/BENCHMARKS.md`. `make bench` writes that page in one run.
///
/// # Errors
/// The README has no such figures.
pub fn figures_not_measured() -> Result<Vec<String>, String> {
    let root = workspace::root();
    let measured = workspace::read(&root.join("docs/BENCHMARKS.md"));
    let measured: Vec<_> = measured.lines().filter_map(cells).collect();
    let readme = workspace::read(&root.join("README.md"));
    let below = readme.split_once("\n## How fast\n").map(|(_, below)| below).unwrap_or_default();
    let quoted: Vec<_> =
        below.lines().take_while(|line| !line.starts_with("## ")).filter_map(cells).skip(2).collect();
    if quoted.is_empty() {
        return Err("README.md has no figures below `## How fast`".to_owned());
    }
    let is_measured = |row: &[&str]| {
        let [what, against, ratio] = row else { return false };
        measured.iter().any(|measured| {
            matches!(measured.as_slice(), [m_what, m_against, _, found, _]
                if m_what == what && m_against == against && found.split(" (").next() == Some(ratio))
        })
    };
    Ok(quoted.iter().filter(|row| !is_measured(row)).map(|row| row.join(" | ")).collect())
}

/// The cells of a row of a table; `None` if the line is not a row.
fn cells(line: &str) -> Option<Vec<&str>> {
    Some(line.strip_prefix('|')?.strip_suffix('|')?.split('|').map(str::trim).collect())
}

/// Removes `.` and `..` from a path.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                plain.pop();
            }
            Component::CurDir => {}
            other => plain.push(other),
        }
    }
    plain
}

/// The lines of a page outside code blocks.
fn prose(page: &str) -> impl Iterator<Item = &str> {
    let mut in_code = false;
    page.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        in_code ^= fence;
        !in_code && !fence
    })
}

/// The targets of the links of a page, without links to other sites.
fn links(page: &str) -> Vec<String> {
    let mut found = Vec::new();
    for line in prose(page) {
        // Text between backquotes is code.
        let spoken: String = line.split('`').step_by(2).collect::<Vec<_>>().join("_");
        for rest in spoken.split("](").skip(1) {
            let target = rest.split(')').next().unwrap_or_default();
            if !target.contains("://") && !target.starts_with("mailto:") {
                found.push(target.to_owned());
            }
        }
    }
    found
}

/// The anchors of a page's headings: lower case, `-` for blanks, without punctuation. A repeated anchor gets
/// a number.
fn anchors(page: &str) -> BTreeSet<String> {
    let mut anchors = BTreeSet::new();
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    for heading in prose(page).filter(|line| line.starts_with('#')) {
        let text = heading.trim_start_matches('#').trim().to_lowercase();
        let anchor: String = text
            .chars()
            .filter_map(|symbol| match symbol {
                ' ' => Some('-'),
                '-' | '_' => Some(symbol),
                other if other.is_alphanumeric() => Some(other),
                _ => None,
            })
            .collect();
        let before = seen.entry(anchor.clone()).or_default();
        anchors.insert(if *before == 0 { anchor } else { format!("{anchor}-{before}") });
        *before += 1;
    }
    anchors
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "# A page\n[a](B.md#c) and [d](#e), `[no](link)`, [x](https://x)\n```\n[no](code)\n# no\n```\n\
                        ## 1. The `[[react]]`: it\n## Twice\n## Twice\n";

    #[test]
    fn links_stand_in_prose() {
        assert_eq!(links(PAGE), ["B.md#c", "#e"]);
    }

    #[test]
    fn headings_are_linked_by_their_words() {
        let wanted = ["1-the-react-it", "a-page", "twice", "twice-1"];
        assert_eq!(anchors(PAGE).iter().map(String::as_str).collect::<Vec<_>>(), wanted);
    }

    #[test]
    fn a_path_goes_up_without_asking_the_disk() {
        assert_eq!(plain(Path::new("/a/docs/../b/./c")), Path::new("/a/b/c"));
    }
}
