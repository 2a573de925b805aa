//! Tests the links and chapters of the book and of the pages at the root.

use r6_testkit::book;

#[test]
fn every_page_is_a_chapter_once() {
    assert_eq!(book::pages_out_of_the_book(), Vec::<String>::new(), "docs/SUMMARY.md");
}

#[test]
fn every_link_leads_somewhere() {
    assert_eq!(book::dead_links(), Vec::<String>::new());
}

#[test]
fn the_readme_quotes_what_was_measured() {
    assert_eq!(book::figures_not_measured(), Ok(Vec::new()), "docs/BENCHMARKS.md says otherwise");
}
