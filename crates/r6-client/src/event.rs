//! Events of the client's side of a connection, as data: connections made and lost, motions that did not
//! complete.
//!
//! [`Hub::happened`](crate::hub::Hub::happened) sends them to subscribers and to the log of `tracing`. What
//! the controller sends unasked is [`crate::Pushed`].

use std::fmt;
use std::net::SocketAddr;
use std::ops::Range;
use std::time::Duration;

use r6_proto::{Language, printable};

use crate::error::NotSent;
use crate::identity::Identity;
use crate::progress::Progress;
use crate::pushed::LostReason;
use crate::stream::error::Cause;

/// The longest text quoted within an event, in characters: names of robots and system errors come from
/// elsewhere.
const MAX_CHARS: usize = 400;

/// Something that happened at the client's side of a connection.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// The first connection of a handle was made.
    Connected,
    /// The connection was made again.
    ConnectedAnew,
    /// The connection ended.
    ConnectionEnded {
        /// How.
        reason: LostReason,
    },
    /// A connection could not be made.
    NotConnected {
        /// Why; the callers that waited for the connection get the same error.
        error: NotSent,
    },
    /// A robot other than the expected one answers at this address.
    AnotherRobot {
        /// The robot that is there.
        found: Identity,
    },
    /// A connection that did not come from the controller was closed.
    StrangerClosed {
        /// Its source.
        peer: SocketAddr,
    },
    /// A request was not answered in time.
    NoReply {
        /// Its word on the wire.
        request: &'static str,
        /// How long the client waited.
        after: Duration,
    },
    /// A motion did not come to its end.
    MotionEnded {
        /// Why.
        cause: Cause,
        /// How far it had come.
        progress: Progress,
        /// Its handle was dropped, so the program may never read the error.
        dropped: bool,
    },
    /// A target is no longer followed, for a reason other than its caller ending it.
    FollowingEnded {
        /// Why.
        cause: Cause,
        /// How far it had come.
        progress: Progress,
    },
    /// Steps are gone from the controller's list, and the arm cannot have made them: another client may have
    /// cleared it.
    StepsNotMade {
        /// Which steps of the motion, counted from 0.
        steps: Range<usize>,
    },
    /// Work in the background of a connection panicked and was given up. The connection continues.
    WorkPanicked,
}

impl Event {
    /// Whether a person should look at it.
    #[must_use]
    pub fn is_warning(&self) -> bool {
        match self {
            Self::Connected
            | Self::ConnectedAnew
            | Self::ConnectionEnded { .. }
            | Self::NotConnected { .. }
            | Self::NoReply { .. }
            | Self::MotionEnded { dropped: false, .. }
            | Self::FollowingEnded { .. } => false,
            Self::AnotherRobot { .. }
            | Self::StrangerClosed { .. }
            | Self::MotionEnded { dropped: true, .. }
            | Self::StepsNotMade { .. }
            | Self::WorkPanicked => true,
        }
    }

    /// The event in words, on one line.
    #[must_use]
    pub fn text(&self, language: Language) -> String {
        match language {
            Language::English => self.english(),
            Language::Chinese => self.chinese(),
        }
    }

    fn english(&self) -> String {
        match self {
            Self::Connected => "connected".to_owned(),
            Self::ConnectedAnew => "connected anew".to_owned(),
            Self::ConnectionEnded { reason } => format!("the connection ended: {reason}"),
            Self::NotConnected { error } => format!("no connection: {}", quoted(error)),
            Self::AnotherRobot { found } => {
                format!("another robot answers at this address: {}", quoted(found))
            }
            Self::StrangerClosed { peer } => {
                format!("a connection from {peer} was closed: it is not the controller")
            }
            Self::NoReply { request, after } => format!("{request}: no reply within {after:?}"),
            Self::MotionEnded { cause, dropped: false, .. } => {
                format!("the motion did not come to its end: {}", quoted(cause))
            }
            Self::MotionEnded { cause, dropped: true, .. } => {
                format!("a motion whose handle was dropped did not come to its end: {}", quoted(cause))
            }
            Self::FollowingEnded { cause, .. } => format!("following ended: {}", quoted(cause)),
            Self::StepsNotMade { steps } => {
                let (first, last) = (steps.start + 1, steps.end);
                format!("gone from the list, and the arm cannot have made them: steps {first} to {last}")
            }
            Self::WorkPanicked => "work in the background panicked and was given up".to_owned(),
        }
    }

    fn chinese(&self) -> String {
        match self {
            Self::Connected => "已连接".to_owned(),
            Self::ConnectedAnew => "已重新连接".to_owned(),
            Self::ConnectionEnded { reason } => format!("连接已断开：{}", in_chinese(*reason)),
            Self::NotConnected { error } => format!("无法连接：{}", quoted(error)),
            Self::AnotherRobot { found } => format!("该地址上应答的是另一台机器人：{}", quoted(found)),
            Self::StrangerClosed { peer } => format!("已关闭来自 {peer} 的连接：不是控制器"),
            Self::NoReply { request, after } => format!("{request}：{after:?} 内没有应答"),
            Self::MotionEnded { cause, dropped: false, .. } => format!("运动没有完成：{}", quoted(cause)),
            Self::MotionEnded { cause, dropped: true, .. } => {
                format!("运动没有完成，其句柄已被丢弃：{}", quoted(cause))
            }
            Self::FollowingEnded { cause, .. } => format!("跟随已结束：{}", quoted(cause)),
            Self::StepsNotMade { steps } => {
                format!("第 {} 至 {} 步已不在列表中，但机器人不可能已执行", steps.start + 1, steps.end)
            }
            Self::WorkPanicked => "后台任务异常终止，已放弃".to_owned(),
        }
    }

    /// Writes it to the log.
    pub(crate) fn log(&self, controller: &str) {
        let event = self.text(Language::English);
        match self {
            Self::WorkPanicked => tracing::error!(controller, "{event}"),
            _ if self.is_warning() => tracing::warn!(controller, "{event}"),
            Self::MotionEnded { progress, .. } | Self::FollowingEnded { progress, .. } => {
                tracing::info!(controller, ?progress, "{event}");
            }
            _ => tracing::info!(controller, "{event}"),
        }
    }
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.english())
    }
}

/// A text from elsewhere, on one line and cut at [`MAX_CHARS`].
fn quoted(text: impl fmt::Display) -> String {
    let text = printable(&text.to_string()).to_string();
    match text.char_indices().nth(MAX_CHARS) {
        Some((end, _)) => text.split_at(end).0.to_owned() + "…",
        None => text,
    }
}

fn in_chinese(reason: LostReason) -> String {
    match reason {
        LostReason::ClosedByPeer => "控制器关闭了连接".to_owned(),
        LostReason::Io(kind) => format!("系统报告 {kind}"),
        LostReason::Stalled => "控制器不再接收数据".to_owned(),
        LostReason::Unresponsive => "控制器不再应答".to_owned(),
        LostReason::OutOfStep => "无法确定哪个应答对应哪个请求".to_owned(),
        LostReason::ClosedHere => "本端关闭了连接".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn every_event() -> Vec<Event> {
        let progress = Progress::default();
        let hostile = "a\nb\u{7}".repeat(1000);
        let found = Identity { firmware: None, machine_name: Some(hostile), axis_count: None };
        vec![
            Event::Connected,
            Event::ConnectedAnew,
            Event::ConnectionEnded { reason: LostReason::Unresponsive },
            Event::NotConnected { error: NotSent::Disconnected },
            Event::AnotherRobot { found },
            Event::StrangerClosed { peer: SocketAddr::from(([192, 0, 2, 1], 9760)) },
            Event::NoReply { request: "query", after: Duration::from_secs(2) },
            Event::MotionEnded { cause: Cause::NotSeen, progress, dropped: false },
            Event::MotionEnded { cause: Cause::NotSeen, progress, dropped: true },
            Event::FollowingEnded { cause: Cause::StoppedHere, progress },
            Event::StepsNotMade { steps: 2..8 },
            Event::WorkPanicked,
        ]
    }

    #[test]
    fn every_event_is_one_short_line_of_its_own_in_both_languages() {
        for language in [Language::English, Language::Chinese] {
            let mut lines: Vec<String> = every_event().iter().map(|event| event.text(language)).collect();
            for line in &lines {
                assert!(line.chars().count() < MAX_CHARS + 80 && !line.contains(['\n', '\u{7}']), "{line}");
                let is_chinese = line.contains(|letter| ('\u{4e00}'..='\u{9fff}').contains(&letter));
                assert_eq!(is_chinese, language == Language::Chinese, "{line}");
            }
            lines.sort();
            lines.dedup();
            assert_eq!(lines.len(), every_event().len(), "each has words of its own");
        }
    }

    #[test]
    fn steps_are_counted_from_one() {
        let gone = Event::StepsNotMade { steps: 2..8 };
        assert!(gone.to_string().ends_with("steps 3 to 8") && gone.is_warning(), "{gone}");
        assert!(gone.text(Language::Chinese).starts_with("第 3 至 8 步"));
    }
}
