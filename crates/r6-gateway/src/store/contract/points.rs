//! Kept points.

use super::*;
use crate::core::point::{MAX_KEPT, PointName};
use crate::store::{KeptPoint, NewPoint};

fn point(name: &str, text: &str) -> NewPoint {
    NewPoint {
        name: PointName::new(name).unwrap(),
        text: text.to_owned(),
        hash: [u8::try_from(text.len()).unwrap(); 32],
        by: author(),
    }
}

fn only_if(tag: Tag) -> Condition {
    Condition { matches: Some(tag.etag()), none_matches: None }
}

#[test]
fn points_have_versions_and_each_change_says_which_one_it_is_for() {
    on_each(|store| {
        let new = Condition::default();
        let belt = point("belt", "").name;
        assert_eq!((store.points(), store.point_versions(&belt)), (Ok(vec![]), Ok(vec![])));
        let first = store.put_point(&point("belt", "a\0é"), &new).unwrap();
        assert_eq!((first.tag.version, first.text.as_str(), first.stored_by.as_str()), (1, "a\0é", "anna"));
        let needed = LibraryError::Unfit(Unfit::NeedsIfMatch);
        assert_eq!(store.put_point(&point("belt", "bb"), &new), Err(needed.clone()));
        let second = store.put_point(&point("belt", "bb"), &only_if(first.tag)).unwrap();
        let missing = LibraryError::Unfit(Unfit::NotThisVersion);
        assert_eq!(store.put_point(&point("belt", "c"), &only_if(first.tag)), Err(missing.clone()));
        let above = store.put_point(&point("above", "x"), &new).unwrap();
        assert_eq!(store.points(), Ok(vec![above, second.clone()]));
        assert_eq!(store.point_versions(&belt), Ok(vec![second.clone(), first.clone()]));
        assert_eq!(store.programs(), Ok(vec![]), "a program of this name is another thing");

        let by = author();
        assert_eq!(store.remove_point(&belt, &new, &by), Err(needed));
        assert_eq!(store.remove_point(&belt, &only_if(first.tag), &by), Err(missing));
        assert_eq!(store.remove_point(&belt, &only_if(second.tag), &by), Ok(()));
        assert_eq!(store.remove_point(&belt, &only_if(second.tag), &by), Err(LibraryError::NoSuchPoint));
        assert_eq!((store.points().unwrap().len(), store.point_versions(&belt)), (1, Ok(vec![])));

        let entries = store.entries(0, 100).unwrap();
        let records: Vec<AuditRecord> =
            entries.iter().map(|entry| serde_json::from_str(&entry.body).unwrap()).collect();
        let deeds: Vec<_> = records.iter().map(|record| &record.deed).collect();
        let Deed::PointStored { point, version: 2, sha256 } = deeds[1] else { panic!("{deeds:?}") };
        assert_eq!((point.as_str(), sha256.as_str()), ("belt", "02".repeat(32).as_str()));
        assert_eq!(deeds[3], &Deed::PointRemoved { point: "belt".to_owned(), version: 2 });
        assert_eq!(deeds.len(), 4, "what was refused is not told");
    });
}

#[test]
fn the_oldest_versions_of_a_point_go() {
    on_each(|store| {
        let mut last: Option<KeptPoint> = None;
        for number in 0..MAX_VERSIONS + 3 {
            let condition = last.map_or_else(Condition::default, |kept| only_if(kept.tag));
            last = Some(store.put_point(&point("belt", &"x".repeat(number)), &condition).unwrap());
        }
        let versions = store.point_versions(&last.unwrap().name).unwrap();
        let numbers: Vec<_> = versions.iter().map(|kept| kept.tag.version).collect();
        assert_eq!(numbers, (4..=MAX_VERSIONS as u64 + 3).rev().collect::<Vec<_>>());
    });
}

#[test]
fn there_is_a_limit_for_the_number_of_points() {
    let folder = tempfile::tempdir().unwrap();
    // The other stores count as it does; a commit for each point takes the disk's time.
    let mut stores: [Box<dyn Store>; 2] =
        [Box::new(Memory::default()), Box::new(Sqlite::open(folder.path()).unwrap())];
    for store in &mut stores {
        for number in 0..MAX_KEPT {
            store.put_point(&point(&format!("p-{number}"), "x"), &Condition::default()).unwrap();
        }
        let more = store.put_point(&point("more", "x"), &Condition::default());
        assert_eq!(more, Err(LibraryError::TooManyPoints));
        let known = store.points().unwrap().remove(0);
        assert!(store.put_point(&point(known.name.as_str(), "y"), &only_if(known.tag)).is_ok());
    }
}
