//! Kept programs.

use super::*;

pub fn version(name: &str, text: &str) -> NewVersion {
    NewVersion {
        name: ProgramName::new(name).unwrap(),
        text: text.to_owned(),
        hash: [u8::try_from(text.len() % 251).unwrap(); 32],
        by: author(),
        kind: ProgramType::Taught,
        ok: false,
        steps: 2,
    }
}

fn only_if(tag: Tag) -> Condition {
    Condition { matches: Some(tag.etag()), none_matches: None }
}

fn numbers_of(versions: &[Kept]) -> Vec<u64> {
    versions.iter().map(|kept| kept.tag.version).collect()
}

#[test]
fn programs_have_versions_and_each_change_says_which_one_it_is_for() {
    on_each(|store| {
        let (new, any) =
            (Condition::default(), Condition { matches: Some("*".to_owned()), none_matches: None });
        let pick = version("pick", "a").name;
        assert_eq!((store.programs(), store.program(&pick, None)), (Ok(vec![]), Ok(None)));
        assert_eq!(store.program_versions(&pick), Ok(vec![]));
        let missing = LibraryError::Unfit(Unfit::NotThisVersion);
        assert_eq!(store.put_program(&version("pick", "a"), &any), Err(missing.clone()));
        let first = store.put_program(&version("pick", "a"), &new).unwrap();
        assert_eq!(
            (first.tag.version, first.bytes, first.kind, first.ok),
            (1, 1, ProgramType::Taught, false)
        );
        let needed = LibraryError::Unfit(Unfit::NeedsIfMatch);
        assert_eq!(store.put_program(&version("pick", "bb"), &new), Err(needed.clone()));
        let second = store.put_program(&version("pick", "bb"), &only_if(first.tag)).unwrap();
        assert_eq!(store.put_program(&version("pick", "c"), &only_if(first.tag)), Err(missing.clone()));
        store.put_program(&version("drop", "x"), &new).unwrap();
        let listed = store.programs().unwrap();
        let names: Vec<_> = listed.iter().map(|kept| (kept.name.as_str(), kept.tag.version)).collect();
        assert_eq!(names, [("drop", 1), ("pick", 2)]);
        assert_eq!(store.program(&pick, None), Ok(Some((second.clone(), "bb".to_owned()))));
        assert_eq!(store.program(&pick, Some(1)), Ok(Some((first.clone(), "a".to_owned()))));
        assert_eq!(store.program(&pick, Some(3)), Ok(None));
        assert_eq!(store.program(&pick, Some(u64::MAX)), Ok(None));
        assert_eq!(store.program_versions(&pick), Ok(vec![second.clone(), first.clone()]));

        let by = author();
        assert_eq!(store.remove_program(&pick, &new, &by), Err(needed));
        assert_eq!(store.remove_program(&pick, &only_if(first.tag), &by), Err(missing));
        assert_eq!(store.remove_program(&pick, &only_if(second.tag), &by), Ok(()));
        assert_eq!(store.remove_program(&pick, &any, &by), Err(LibraryError::NoSuchProgram));
        assert_eq!((store.program(&pick, None), store.program(&pick, Some(1))), (Ok(None), Ok(None)));
        assert_eq!(store.programs().unwrap().len(), 1);
        // It is another program: the tag of the old one does not fit it.
        let again = store.put_program(&version("pick", "other"), &new).unwrap();
        assert!(again.tag.version == 1 && again.tag.etag() != first.tag.etag());

        let entries = store.entries(0, 100).unwrap();
        let records: Vec<AuditRecord> =
            entries.iter().map(|entry| serde_json::from_str(&entry.body).unwrap()).collect();
        let deeds: Vec<_> = records.iter().map(|record| &record.deed).collect();
        let Deed::ProgramStored { program, version: 2, sha256 } = deeds[1] else { panic!("{deeds:?}") };
        assert_eq!((program.as_str(), sha256.as_str()), ("pick", "02".repeat(32).as_str()));
        assert_eq!(deeds[3], &Deed::ProgramRemoved { program: "pick".to_owned(), version: 2 });
        assert_eq!((records[0].actor.as_str(), records.len()), ("anna", 5), "what was refused is not told");
        assert_eq!(head(store).unwrap().0, 5);
    });
}

#[test]
fn the_oldest_versions_go_and_there_is_a_limit_for_all_programs() {
    on_each(|store| {
        let mut last: Option<Kept> = None;
        for number in 0..MAX_VERSIONS + 3 {
            let condition = last.map_or_else(Condition::default, |kept| only_if(kept.tag));
            last = Some(store.put_program(&version("pick", &"x".repeat(number)), &condition).unwrap());
        }
        let last = last.unwrap();
        let versions = store.program_versions(&last.name).unwrap();
        let wanted: Vec<_> = (4..=MAX_VERSIONS as u64 + 3).rev().collect();
        assert_eq!(numbers_of(&versions), wanted);
        assert_eq!(store.program(&last.name, Some(3)), Ok(None));

        // Many long texts: what is there stays as it is.
        let long = "y".repeat(16 << 20);
        let mut put = |number: usize| {
            store.put_program(&version(&format!("long-{number}"), &long), &Condition::default())
        };
        assert!((0..3).all(|number| put(number).is_ok()));
        assert_eq!(put(3), Err(LibraryError::TooManyBytes));
        assert_eq!(store.programs().unwrap().len(), 4);
        assert_eq!(store.program_versions(&last.name).unwrap().len(), MAX_VERSIONS);
    });
}

#[test]
fn there_is_a_limit_for_the_number_of_programs() {
    // One store in memory: a commit for each would take the disk's time.
    let mut store = Memory::default();
    for number in 0..MAX_PROGRAMS {
        store.put_program(&version(&format!("p-{number}"), "x"), &Condition::default()).unwrap();
    }
    let more = store.put_program(&version("more", "x"), &Condition::default());
    assert_eq!(more, Err(LibraryError::TooManyPrograms));
    let known = store.programs().unwrap().remove(0);
    assert!(store.put_program(&version(known.name.as_str(), "y"), &only_if(known.tag)).is_ok());
}
