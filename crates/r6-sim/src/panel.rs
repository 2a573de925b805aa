//! The panel simulates the operator at the machine, as a local HTTP API.
//!
//! | request | what it does |
//! |---|---|
//! | `GET /v1/controllers` | the controllers of this process, numbered from 1 |
//! | `GET /v1/controllers/{n}` | the state of the machine that an operator can see |
//! | `GET /v1/controllers/{n}/status` | the state as read over its port, as in `r6 status --json` |
//! | `POST /v1/controllers/{n}/actions` | carries out an [`r6_api::panel::Action`] |
//! | `GET /v1/controllers/{n}/faults` | the faults that the controller can be given |
//! | `PUT /v1/controllers/{n}/programs/{name}` | loads a program; the body is its text |
//! | `GET /v1/openapi.json` | this API in OpenAPI; committed as `openapi/panel.json` |
//!
//! There is no login, so by default it listens on this machine only, and web pages cannot use it.
//!
//! # An action
//!
//! `r6 panel estop`:
//!
//! 1. `r6/src/cmd/panel.rs` makes an [`r6_api::panel::Action`], and `cmd/panel/http.rs` posts it.
//! 2. `r6-http/src/access.rs` refuses it if a web page from elsewhere sent it.
//! 3. `panel/routes.rs` reads it, and `panel/convert.rs` converts it to a `PanelAction`. Only there do HTTP
//!    and the controller meet.
//! 4. `Controller::operate` hands it to `r6-controller/src/machine/panel.rs`. Moves by hand are in
//!    `machine/hand.rs`, programs that are loaded in `machine/loading.rs`. `Refused`
//!    (`r6-controller/src/panel.rs`) says what is refused, and why.
//! 5. The reply is the state that an operator would then see (`snapshot` in `panel/convert.rs`).
//!
//! `openapi/panel.json` is generated from the code. A test fails if it is out of date.

mod convert;
mod routes;

use std::net::SocketAddr;

pub use convert::code;

/// The default port of the panel for `r6 up` and `r6 panel`.
pub const DEFAULT_PORT: u16 = 9770;

/// The panel of these controllers as a service, for your own server, which has to listen at this address.
pub fn router(controllers: &[crate::ControllerHandle], address: SocketAddr) -> axum::Router {
    routes::router(controllers.into(), address)
}

/// The OpenAPI description of the panel, as `GET /v1/openapi.json` returns it.
#[must_use]
pub fn openapi() -> String {
    let (_, api) = routes::routes().split_for_parts();
    // A description that serde cannot write would be a fault of its derive; the test of the committed file
    // would fail.
    let mut text = api.to_pretty_json().unwrap_or_default();
    text.push('\n');
    text
}
