use super::*;

#[test]
fn every_shipped_program_is_in_the_library() {
    let library = Library::default();
    let shipped: Vec<_> = Library::shipped().map(|(name, _)| name).collect();
    for (name, text) in Library::shipped() {
        Program::read(name, text).unwrap_or_else(|error| panic!("{error}"));
    }
    assert_eq!(library.names().collect::<Vec<_>>(), shipped);
    assert_eq!(library.programs().find_map(|program| library.missing_call(program)), None);
}

#[test]
fn a_library_is_bounded_and_knows_what_is_missing() {
    let mut library = Library::empty();
    let program = Program::read("a", "[[step]]\ndo=\"call\"\nprogram=\"remot\"").unwrap();
    library.load("remote", "[[step]]\ndo=\"remote\"").unwrap();
    assert_eq!(
        library.missing_call(&program).as_deref(),
        Some("it calls `remot`, which is not there; nearest: `remote`")
    );
    for n in 1..library::MAX_PROGRAMS {
        library.load(&format!("p{n}"), "").unwrap();
    }
    assert_eq!(library.load("one-more", ""), Err(LibraryError::Full));
    library.load("p1", "[[step]]\ndo=\"end\"").unwrap();
    assert_eq!(library.named("p1").unwrap().steps(), [Step::End], "in place of the one of that name");
}

/// docs/PROGRAMS.md has a row for every shipped program and no other rows.
#[test]
fn the_page_tells_every_shipped_program() {
    let page = include_str!("../../../../docs/PROGRAMS.md");
    let (_, rest) = page.split_once("## Those that come").unwrap();
    let rows = rest.lines().skip_while(|line| !line.starts_with("|---")).skip(1);
    let mut names: Vec<_> =
        rows.take_while(|line| line.starts_with('|')).map(|line| line.split('`').nth(1).unwrap()).collect();
    names.sort_unstable();
    assert_eq!(names, Library::shipped().map(|(name, _)| name).collect::<Vec<_>>());
}
