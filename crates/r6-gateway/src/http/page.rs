//! The dashboard: files that the build script embeds, and a page in their place if they were not built. A
//! build for development reads them from `page/built`, or from the folder that `R6_PAGE` names, so that a
//! change of the page needs no build of the gateway.
//!
//! The files say nothing about robots, so they need no token. The page signs in and uses the API as every
//! other client.

use std::borrow::Cow;
use std::path::PathBuf;

use axum::extract::Path;
use axum::extract::rejection::PathRejection;
use axum::http::header::{
    ACCEPT, CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, REFERRER_POLICY,
    X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use r6_api::{Code, Problem};
use r6_http::Refusal;

include!(concat!(env!("OUT_DIR"), "/page.rs"));

/// The pages of all robots: those of `web/src/route.ts`.
const PAGES: [&str; 9] =
    ["alarms", "production", "history", "audit", "connections", "users", "tokens", "settings", "gallery"];

/// The page itself.
const INDEX: &str = "index.html";

/// What stands at its place if it was not built.
const MISSING: &str = include_str!("page/missing.html");

/// The page loads its own files and speaks with this gateway. No other page may frame it.
const POLICY: &str =
    "default-src 'self'; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The names of files in `assets` have a hash of their content, so a browser never asks again for a file
/// that it has.
const FOR_EVER: &str = "public, max-age=31536000, immutable";

/// The page names the files of its build, so it is asked for each time.
const NEVER: &str = "no-store";

/// The dashboard: the hall. It needs no token; the page signs in. 404 if this build has no dashboard: then
/// the page says how to build it.
#[utoipa::path(get, path = "/", security(()), responses(
    (status = 200, description = "The page", content_type = "text/html"),
    (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
    (status = 404, description = "This build has no dashboard", content_type = "text/html"),
))]
pub async fn hall() -> impl IntoResponse {
    index()
}

/// The dashboard: one robot. The same page as `/`.
#[utoipa::path(get, path = "/robots/{name}", operation_id = "page_of_robot", security(()), params(("name" = String, Path, description = "The name of the robot")), responses(
    (status = 200, description = "The page", content_type = "text/html"),
    (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
    (status = 404, description = "This build has no dashboard", content_type = "text/html"),
))]
pub async fn robot() -> impl IntoResponse {
    index()
}

/// The dashboard: the programs of one robot. The same page as `/`.
#[utoipa::path(get, path = "/robots/{name}/teach", operation_id = "teach", security(()), params(("name" = String, Path, description = "The name of the robot")), responses(
    (status = 200, description = "The page", content_type = "text/html"),
    (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
    (status = 404, description = "This build has no dashboard", content_type = "text/html"),
))]
pub async fn teach() -> impl IntoResponse {
    index()
}

/// The dashboard: one program of one robot. The same page as `/`.
#[utoipa::path(get, path = "/robots/{name}/teach/{program}", operation_id = "teach_program", security(()),
    params(
        ("name" = String, Path, description = "The name of the robot"),
        ("program" = String, Path, description = "The name of the program"),
    ),
    responses(
        (status = 200, description = "The page", content_type = "text/html"),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
        (status = 404, description = "This build has no dashboard", content_type = "text/html"),
    )
)]
pub async fn teach_program() -> impl IntoResponse {
    index()
}

/// The dashboard: a page of all robots, such as `/alarms`. The same page as `/`.
#[utoipa::path(get, path = "/{page}", operation_id = "page_of_hall", security(()),
    params(("page" = String, Path, description = "`alarms`, `production`, `history`, `audit`, `connections`, `users`, `tokens`, `settings` or `gallery`")),
    responses(
        (status = 200, description = "The page", content_type = "text/html"),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
        (status = 404, description = "`no_such_path`: there is no such page; or this build has no dashboard: then it is a page that says so. A browser gets the page", body = Problem),
    )
)]
pub async fn of_hall(
    page: Result<Path<String>, PathRejection>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    if page.is_ok_and(|page| PAGES.contains(&page.as_str())) {
        return Ok(index().into_response());
    }
    let message = "there is no such page; GET /v1/openapi.json names all paths";
    if wants_page(&headers) { Ok(none()) } else { Err(Refusal::not_found(Code::NoSuchPath, message)) }
}

/// Whether somebody looks for a page: a browser in which an address was typed or followed.
pub fn wants_page(headers: &HeaderMap) -> bool {
    let accepts = headers.get(ACCEPT).and_then(|value| value.to_str().ok()).unwrap_or_default();
    accepts.split(',').any(|one| one.split(';').next().is_some_and(|kind| kind.trim() == "text/html"))
}

/// The dashboard where there is no page: it says so, and shows the way to the hall.
pub fn none() -> Response {
    (StatusCode::NOT_FOUND, index()).into_response()
}

/// A file of the dashboard: a script, a style sheet, a picture.
#[utoipa::path(get, path = "/assets/{file}", security(()), params(("file" = String, Path, description = "The name of the file")), responses(
    (status = 200, description = "The file"),
    (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
    (status = 404, description = "`no_such_path`: this build has no such file", body = Problem),
))]
pub async fn asset(file: Result<Path<String>, PathRejection>) -> Result<impl IntoResponse, Refusal> {
    let none = || {
        let message = "the dashboard of this gateway has no such file: load its page again";
        Refusal::not_found(Code::NoSuchPath, message)
    };
    let path = format!("assets/{}", file.map_err(|_| none())?.0);
    let bytes = find(&path).ok_or_else(none)?;
    Ok((headers(content_type(&path), FOR_EVER), bytes))
}

fn index() -> impl IntoResponse {
    let (status, bytes) = match find(INDEX) {
        Some(bytes) => (StatusCode::OK, bytes),
        None => (StatusCode::NOT_FOUND, Cow::Borrowed(MISSING.as_bytes())),
    };
    (status, headers("text/html; charset=utf-8", NEVER), bytes)
}

fn find(path: &str) -> Option<Cow<'static, [u8]>> {
    if cfg!(debug_assertions) {
        return read(path).map(Cow::Owned);
    }
    embedded(FILES, path).map(Cow::Borrowed)
}

/// The file of this name among those that the build script wrote, which are in the order of their names.
fn embedded(files: &[(&str, &'static [u8])], path: &str) -> Option<&'static [u8]> {
    let at = files.binary_search_by_key(&path, |(name, _)| name).ok()?;
    files.get(at).map(|(_, bytes)| *bytes)
}

/// The file of this name, in a build for development.
fn read(path: &str) -> Option<Vec<u8>> {
    let folder = std::env::var_os("R6_PAGE")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("page/built"), PathBuf::from);
    let name = path.strip_prefix("assets/").unwrap_or(path);
    // A name of one file, so that nothing outside the folder can be asked for.
    let is_plain =
        !name.starts_with('.') && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c));
    if is_plain { std::fs::read(folder.join(path)).ok() } else { None }
}

fn headers(content_type: &'static str, cache: &'static str) -> [(HeaderName, HeaderValue); 5] {
    [
        (CONTENT_TYPE, HeaderValue::from_static(content_type)),
        (CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY)),
        (X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
        (REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
        (CACHE_CONTROL, HeaderValue::from_static(cache)),
    ]
}

/// The type of a file, by the end of its name: those that the build of the dashboard writes.
fn content_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map(|(_, end)| end) {
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("txt") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_has_a_type_and_nothing_else_is_found() {
        let built = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("page/built");
        let assets = std::fs::read_dir(built.join("assets")).into_iter().flatten();
        for file in assets {
            let path = format!("assets/{}", file.unwrap().file_name().to_string_lossy());
            assert!(find(&path).is_some(), "{path} is not found");
            assert_ne!(content_type(&path), "application/octet-stream", "{path} has no type");
        }
        for path in
            ["assets/no-such-file.js", "assets/../index.html", "assets//etc/passwd", "../built/index.html"]
        {
            assert_eq!(find(path), None, "{path}");
        }
    }

    #[test]
    fn a_file_is_found_among_those_that_a_release_has() {
        let files: [(&str, &[u8]); 3] =
            [("assets/a-1.js", b"one"), ("assets/b-2.css", b"two"), ("index.html", b"three")];
        for (name, bytes) in files {
            assert_eq!(embedded(&files, name), Some(bytes));
        }
        for path in ["", "assets", "assets/a-1.j", "assets/a-1.jsx", "index.htm"] {
            assert_eq!(embedded(&files, path), None, "{path}");
        }
    }
}
