//! `--store URL`: the database of gateways that share their store. The URL may have a password in it, so what
//! is wrong with it is told without it.

use std::convert::Infallible;
use std::path::Path;

use r6_gateway::{At, Database};

use crate::exit::Failure;

/// What was typed behind `--store`. It is read after the command line, whose errors repeat what they refuse.
#[derive(Clone, Debug)]
pub struct StoreUrl(Result<Database, String>);

impl StoreUrl {
    /// Takes any text. [`Self::database`] says whether it names a database.
    ///
    /// # Errors
    /// None.
    pub fn read(text: &str) -> Result<Self, Infallible> {
        Ok(Self(Database::parse(text)))
    }

    /// The database.
    ///
    /// # Errors
    /// The text names none. The text is not in the message.
    pub fn database(&self) -> Result<Database, Failure> {
        self.0.clone().map_err(|wrong| Failure::usage(format!("the URL of --store is wrong: {wrong}")))
    }
}

/// Where the store is: in the database, or else in the folder.
///
/// # Errors
/// As [`StoreUrl::database`].
pub fn at(store: Option<&StoreUrl>, data: &Path) -> Result<At, Failure> {
    match store {
        Some(store) => Ok(At::Database(store.database()?)),
        None => Ok(At::Folder(data.to_owned())),
    }
}
