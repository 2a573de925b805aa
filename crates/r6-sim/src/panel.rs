//! The panel: what a person does at the machine, as a local HTTP API.
//!
//! | request | what it does |
//! |---|---|
//! | `GET /v1/controllers` | the controllers of this process, numbered from 1 |
//! | `GET /v1/controllers/{n}` | what a person would see at the machine |
//! | `GET /v1/controllers/{n}/status` | the state as the controller tells it over its port, as `r6 status --json` prints it |
//! | `POST /v1/controllers/{n}/actions` | does what an [`r6_api::panel::Action`] says |
//! | `PUT /v1/controllers/{n}/programs/{name}` | loads a program, whose text is the body |
//! | `GET /v1/openapi.json` | all this for programs; committed as `openapi/panel.json` |
//!
//! There is no login, so it listens on this machine alone unless told otherwise, and pages of a browser cannot use it.

mod convert;
mod routes;

use std::net::SocketAddr;

pub use convert::code;

/// Where `r6 up` offers the panel and `r6 panel` looks for it, unless told otherwise.
pub const DEFAULT_PORT: u16 = 9770;

/// The panel of these controllers as a service, for a server of one's own: it believes that it listens at this address.
pub fn router(controllers: &[crate::ControllerHandle], address: SocketAddr) -> axum::Router {
    routes::router(controllers.into(), address)
}

/// The OpenAPI description of the panel, as `GET /v1/openapi.json` gives it.
#[must_use]
pub fn openapi() -> String {
    let (_, api) = routes::routes().split_for_parts();
    // A description that serde cannot write would be a fault of its derive; the test of the committed file sees it.
    let mut text = api.to_pretty_json().unwrap_or_default();
    text.push('\n');
    text
}
