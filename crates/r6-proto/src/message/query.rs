//! Queries and their replies (manual 4.1).

use std::fmt;

use crate::address::{Address, UnknownAddress};
use crate::value::{Value, Values};

/// A read request.
#[derive(Clone, Copy, Debug)]
pub struct Query<'a> {
    /// The addresses, as sent.
    pub addresses: Values<'a>,
}

impl<'a> Query<'a> {
    /// Each address as sent, with its meaning.
    pub fn resolved(
        &self,
    ) -> impl ExactSizeIterator<Item = (Value<'a>, Result<Address, UnknownAddress>)> + use<'a> {
        self.addresses.iter().map(|word| (word, resolve(word)))
    }
}

fn resolve(word: Value<'_>) -> Result<Address, UnknownAddress> {
    match word.address() {
        Some(address) => Ok(address),
        None => Address::parse(&word.text()),
    }
}

/// The values that answer a query.
///
/// Controllers leave unsupported addresses out of the values but not out of the echoed addresses (captured,
/// unit C). So the two lists are paired only if their lengths agree.
#[derive(Clone, Copy, Debug)]
pub struct QueryReply<'a> {
    /// The echoed addresses, if the firmware sends them.
    pub addresses: Option<Values<'a>>,
    /// The values.
    pub values: Values<'a>,
}

impl<'a> QueryReply<'a> {
    /// Returns the values, if there are as many as the query asked for.
    ///
    /// # Errors
    /// [`LengthMismatch`] otherwise, because it is then unknown which value belongs to which address.
    pub fn aligned(&self, asked: usize) -> Result<Values<'a>, LengthMismatch> {
        if self.values.len() == asked {
            Ok(self.values)
        } else {
            Err(LengthMismatch { asked, answered: self.values.len() })
        }
    }
}

/// A reply with more or fewer values than the query has addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LengthMismatch {
    /// How many addresses the query has.
    pub asked: usize,
    /// How many values came.
    pub answered: usize,
}

impl fmt::Display for LengthMismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} addresses were asked for and {} values came: the controller leaves out what it does not know, \
             so none of them can be assigned; ask for the addresses one by one",
            self.asked, self.answered
        )
    }
}

impl std::error::Error for LengthMismatch {}
