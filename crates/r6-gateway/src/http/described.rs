//! The refusals that many routes describe alike.

use std::collections::BTreeMap;

use utoipa::IntoResponses;
use utoipa::openapi::{ContentBuilder, OpenApi, Ref, RefOr, Response, ResponseBuilder};

macro_rules! refusals {
    ($($(#[$doc:meta])* $name:ident { $($status:literal $description:literal)+ })+) => {$(
        $(#[$doc])*
        pub struct $name;

        impl IntoResponses for $name {
            fn responses() -> BTreeMap<String, RefOr<Response>> {
                [$(refusal($status, $description)),+].into()
            }
        }
    )+};
}

refusals! {
    /// Of every route that needs a token or a session.
    OfToken {
        "401" "`no_token`, `no_session`"
        "403" "`foreign_host`, `foreign_origin`"
        "429" "`too_many_requests`"
    }
    /// Of every route that changes something and needs a right.
    OfChange {
        "401" "`no_token`, `no_session`"
        "403" "`not_allowed`, `bad_csrf`, `foreign_host`, `foreign_origin`"
        "429" "`too_many_requests`"
    }
    /// Of every route that needs a right.
    OfRight {
        "401" "`no_token`, `no_session`"
        "403" "`not_allowed`, `foreign_host`, `foreign_origin`"
        "429" "`too_many_requests`"
    }
    /// Of every route that takes JSON.
    OfBody {
        "400" "`bad_json`, `bad_body`"
        "408" "`too_slow`"
        "413" "`too_long`"
        "415" "`not_json`"
    }
}

/// Describes that a gateway refuses what another one has to do: every route that needs a token or a session.
pub fn add_no_owner(api: &mut OpenApi) {
    // Whether the gateway is ready is not refused: that is the answer.
    for (_, item) in api.paths.paths.iter_mut().filter(|(path, _)| *path != "/readyz") {
        let operations =
            [&mut item.get, &mut item.put, &mut item.post, &mut item.delete].into_iter().flatten();
        for operation in operations.filter(|operation| operation.responses.responses.contains_key("401")) {
            match operation.responses.responses.get_mut("503") {
                Some(RefOr::T(response)) => response.description.push_str("; `no_owner`"),
                Some(RefOr::Ref(_)) => {}
                None => operation.responses.responses.extend([refusal("503", "`no_owner`")]),
            }
        }
    }
}

fn refusal(status: &str, description: &str) -> (String, RefOr<Response>) {
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
    let response = ResponseBuilder::new().description(description).content("application/json", content);
    (status.to_owned(), response.build().into())
}
