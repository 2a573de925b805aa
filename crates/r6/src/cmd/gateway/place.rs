//! `--store URL`: the database of gateways that share their store. The URL may have a password in it, so what
//! is wrong with it is told without it. Other users of the machine see the command line, so the password may
//! be in a file instead, which PostgreSQL's own programs read too.

use std::convert::Infallible;
use std::path::Path;

use r6_gateway::{At, Database};

use crate::exit::Failure;
use crate::text_file;

/// What the URL of a database begins with.
const SCHEMES: [&str; 2] = ["postgres://", "postgresql://"];

/// The variable with the name of a file of passwords.
const PASSWORD_FILE: &str = "PGPASSFILE";

/// The longest file of passwords that is read. A line has some dozen bytes.
const MAX_PASSWORD_FILE: usize = 64 * 1024;

/// What was typed behind `--store`. It is read after the command line, whose errors repeat what they refuse.
#[derive(Clone, Debug)]
pub struct StoreUrl(Result<Database, String>);

impl StoreUrl {
    /// Takes any text. [`Self::database`] says whether it names a database.
    ///
    /// # Errors
    /// None.
    pub fn read(text: &str) -> Result<Self, Infallible> {
        if !SCHEMES.iter().any(|scheme| text.starts_with(scheme)) {
            return Ok(Self(Err(format!("it has to begin with {}", SCHEMES.join(" or ")))));
        }
        Ok(Self(Database::parse(text)))
    }

    /// The database.
    ///
    /// # Errors
    /// The text names none. The text is not in the message. Or `PGPASSFILE` names a file that cannot be read,
    /// or that others can read.
    pub fn database(&self) -> Result<Database, Failure> {
        let database = self.0.clone();
        let database =
            database.map_err(|wrong| Failure::usage(format!("the URL of --store is wrong: {wrong}")))?;
        match std::env::var_os(PASSWORD_FILE).filter(|path| !path.is_empty()) {
            Some(path) if !database.has_password() => with_password_of(Path::new(&path), database),
            Some(_) | None => Ok(database),
        }
    }
}

fn with_password_of(path: &Path, database: Database) -> Result<Database, Failure> {
    let wrong = |why: String| Failure::usage(format!("{PASSWORD_FILE}={}: {why}", path.display()));
    let text = text_file::read(path, "a file of passwords", MAX_PASSWORD_FILE);
    let text = text.map_err(wrong)?;
    #[cfg(unix)]
    {
        let meta = std::fs::metadata(path).map_err(|error| wrong(error.to_string()))?;
        if std::os::unix::fs::PermissionsExt::mode(&meta.permissions()) & 0o077 != 0 {
            return Err(wrong("other users can read it".to_owned()).advise("chmod 600"));
        }
    }
    // The server says so if it wants one.
    Ok(database.with_password_of(&text).unwrap_or(database))
}

/// Where the store is: in the database, or else in the folder.
///
/// # Errors
/// As [`StoreUrl::database`]. Or the folder is of a gateway whose store is in a database.
pub fn at(store: Option<&StoreUrl>, data: &Path) -> Result<At, Failure> {
    match store {
        Some(store) => Ok(At::Database(store.database()?)),
        None => {
            must_have_store(data)?;
            Ok(At::Folder(data.to_owned()))
        }
    }
}

/// Refuses the folder of a gateway whose store is in a database: users and tokens that are put there count
/// nowhere.
///
/// # Errors
/// It is one.
pub fn must_have_store(data: &Path) -> Result<(), Failure> {
    if !r6_gateway::is_of_database(data) {
        return Ok(());
    }
    let what = format!("--data {}: this folder is of a gateway with --store", data.display());
    Err(Failure::usage(what).advise(
        "give --store URL, as the gateway has it: users, tokens, stops and the audit log are in the database",
    ))
}
