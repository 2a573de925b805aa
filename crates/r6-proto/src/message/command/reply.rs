//! Replies to commands, AddPoints and AddRCC, in every dialect.

use std::borrow::Cow;

use crate::value::{Value, Values};

/// The reply to a command, to AddPoints or to AddRCC (manual 4.2, 5.2, 6).
#[derive(Clone, Copy, Debug)]
pub struct CommandReply<'a> {
    words: Values<'a>,
    text: Option<Value<'a>>,
}

/// The meaning of a [`CommandReply`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Accepted. This does not mean that anything moves.
    Ok,
    /// Refused, with the controller's reason if it gives one.
    Refused(Option<String>),
    /// AddPoints: how many points the controller took.
    Points(u64),
    /// Neither accepted nor refused: the words as they stand.
    Unclear(String),
}

impl<'a> CommandReply<'a> {
    pub(crate) fn of_words(words: Values<'a>) -> Self {
        Self { words, text: None }
    }

    pub(crate) fn of_text(text: Value<'a>) -> Self {
        Self { words: Values { bytes: text.bytes, nodes: &[] }, text: Some(text) }
    }

    /// The words of `cmdReply`; empty if it is a bare text.
    #[must_use]
    pub fn words(&self) -> Values<'a> {
        self.words
    }

    /// The command that it answers, as the controller names it. Firmware before 2.0.2.1 does not name it.
    #[must_use]
    pub fn command(&self) -> Option<Cow<'a, str>> {
        let first = self.words.at(0)?;
        (self.words.len() >= 2).then(|| first.text())
    }

    /// Its meaning in any dialect: `["ok"]`, `""`, `[cmd,"ok"]`, `[cmd,"err",message]`, `["AddPoints","2"]`.
    #[must_use]
    pub fn outcome(&self) -> Outcome {
        let verdict = match (self.text, self.words.len()) {
            (Some(text), _) => Some(text),
            (None, 0 | 1) => self.words.at(0),
            (None, _) => self.words.at(1),
        };
        let Some(verdict) = verdict else { return Outcome::Refused(None) };
        let of_points =
            self.words.len() >= 2 && self.words.at(0).is_some_and(|word| *word.word() == *b"AddPoints");
        match &*verdict.text() {
            "ok" => Outcome::Ok,
            "err" => Outcome::Refused(self.words.at(2).map(|message| message.text().into_owned())),
            "" => Outcome::Refused(None),
            text => match text.parse() {
                Ok(points) if of_points => Outcome::Points(points),
                Ok(_) | Err(_) => Outcome::Unclear(text.chars().take(48).collect()),
            },
        }
    }
}
