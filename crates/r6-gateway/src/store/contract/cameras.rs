//! Grants of cameras.

use super::{author, on_each, token};
use crate::core::camera::{Camera, CameraGrant, MAX_GRANTS};
use crate::core::name::RobotName;
use crate::expiry::Expiry;
use crate::store::NewToken;
use crate::store::{NewGrant, Store, StoreError};
use r6_api::gateway::{AuditRecord, Deed};

fn grant(robot: &str, camera: i64, token: i64) -> NewGrant {
    NewGrant { robot: RobotName::new(robot).unwrap(), camera: Camera::new(camera).unwrap(), token }
}

fn told(store: &mut dyn Store, of: Option<&str>) -> Vec<(String, u16, i64)> {
    let of = of.map(|name| RobotName::new(name).unwrap());
    let grants = store.cameras(of.as_ref()).unwrap();
    grants.into_iter().map(|(robot, grant)| (robot.to_string(), grant.camera.number(), grant.token)).collect()
}

fn records(store: &mut dyn Store) -> Vec<AuditRecord> {
    let entries = store.entries(0, 1_000).unwrap();
    entries.iter().map(|entry| serde_json::from_str(&entry.body).unwrap()).collect()
}

#[test]
fn a_grant_of_a_camera_is_given_once_revoked_once_and_audited() {
    on_each(|store| {
        let by = &author();
        assert_eq!(store.add_token(&token(1, None), by), Ok(1));
        assert_eq!(store.add_token(&token(2, Some("press")), by), Ok(2));
        // A token that has ended.
        let ended = NewToken { expires: Some(Expiry(1)), ..token(3, None) };
        assert_eq!(store.add_token(&ended, by), Ok(3));
        assert_eq!(store.grant_camera(&grant("saw", 999, 1), by), Ok(true));
        assert_eq!(store.grant_camera(&grant("press", 1, 1), by), Ok(true));
        assert_eq!(store.grant_camera(&grant("press", 0, 2), by), Ok(true));
        assert_eq!(store.grant_camera(&grant("press", 0, 2), by), Ok(false), "it has it");
        let of = |robot: &str, camera, token| (robot.to_owned(), camera, token);
        assert_eq!(told(store, Some("press")), [of("press", 0, 2), of("press", 1, 1)]);
        assert_eq!(told(store, None), [of("press", 0, 2), of("press", 1, 1), of("saw", 999, 1)]);
        assert_eq!(told(store, Some("lathe")), []);
        let camera = Camera::new(0).unwrap();
        let first = CameraGrant { camera, token: 2, by: by.actor.clone(), at: by.time.clone() };
        assert_eq!(store.cameras(Some(&RobotName::new("press").unwrap())).unwrap()[0].1, first);

        for (wrong, error) in [
            (grant("press", 0, 3), StoreError::NoSuchToken(3)),
            (grant("press", 0, 4), StoreError::NoSuchToken(4)),
            (grant("saw", 0, 2), StoreError::TokenOfAnother(2)),
        ] {
            assert_eq!(store.grant_camera(&wrong, by), Err(error));
        }
        assert_eq!(store.revoke_camera(&grant("press", 1, 1), by), Ok(true));
        assert_eq!(store.revoke_camera(&grant("press", 1, 1), by), Ok(false));
        assert_eq!(store.revoke_camera(&grant("press", 1, 2), by), Ok(false));
        assert_eq!(told(store, Some("press")), [of("press", 0, 2)]);

        let told_of: Vec<_> = records(store).into_iter().skip(3).collect();
        let deeds: Vec<_> = told_of.iter().map(|record| (record.robot.as_deref(), &record.deed)).collect();
        let given = |camera, token| Deed::CameraGranted { camera, token };
        assert_eq!(
            deeds,
            [
                (Some("saw"), &given(999, 1)),
                (Some("press"), &given(1, 1)),
                (Some("press"), &given(0, 2)),
                (Some("press"), &Deed::CameraRevoked { camera: 1, token: 1 }),
            ]
        );
        assert!(told_of.iter().all(|record| record.actor == by.actor && record.source == by.source));
    });
}

#[test]
fn the_grants_of_a_token_go_with_it() {
    on_each(|store| {
        let by = &author();
        for number in 1..=2 {
            assert_eq!(store.add_token(&token(number, None), by), Ok(number.into()));
            store.grant_camera(&grant("press", 0, number.into()), by).unwrap();
        }
        assert_eq!(store.revoke_token(1, by), Ok(true));
        assert_eq!(told(store, None), [("press".to_owned(), 0, 2)]);
        assert_eq!(store.grant_camera(&grant("press", 0, 1), by), Err(StoreError::NoSuchToken(1)));
    });
}

#[test]
fn a_robot_has_so_many_grants_at_most() {
    on_each(|store| {
        let by = &author();
        store.add_token(&token(1, None), by).unwrap();
        for camera in 0..i64::try_from(MAX_GRANTS).unwrap() {
            assert_eq!(store.grant_camera(&grant("press", camera, 1), by), Ok(true));
        }
        assert_eq!(store.grant_camera(&grant("press", 0, 1), by), Ok(false), "it is there");
        assert_eq!(store.grant_camera(&grant("press", 999, 1), by), Err(StoreError::TooManyGrants));
        assert_eq!(store.grant_camera(&grant("saw", 999, 1), by), Ok(true));
        assert_eq!(store.revoke_camera(&grant("press", 7, 1), by), Ok(true));
        assert_eq!(store.grant_camera(&grant("press", 999, 1), by), Ok(true));
    });
}
