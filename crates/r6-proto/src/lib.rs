//! The remote communication protocol of Huacheng R6 / HC1 robot controllers: JSON objects over TCP.
//!
//! [`frame`] turns bytes into frames, and [`message`] turns frames into messages. [`request`] and [`reply`]
//! turn requests and replies into bytes. A [`client`] and a [`server`] session combine these for the two ends
//! of a connection. This crate has no I/O, no clock and no task: bytes and points in time come in; bytes,
//! events and deadlines go out.
//!
//! Decoding is tolerant: it reads every form that clients and controllers are known to send. Encoding is
//! strict: it writes one compact form. `docs/PROTOCOL.md` describes the protocol field by field.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod address;
pub mod alarm;
pub mod axis;
pub mod client;
pub mod dialect;
mod encode;
pub mod error;
pub mod frame;
pub mod grid;
pub mod io_point;
mod json;
mod language;
pub mod message;
pub mod mode;
mod printable;
pub mod readiness;
pub mod reply;
pub mod request;
pub mod server;
mod sixteen_bytes;
mod spelling;
mod text;
pub mod time;
pub mod value;

pub use address::{ADDRESSES, Address, Port, RegisterIndex};
pub use axis::{AXES, AxisIndex, AxisMask};
pub use json::MAX_DEPTH;
pub use language::Language;
pub use message::{Body, Command, CommandName, Decoder, Effect, Message, Reading, RequestType};
pub use mode::OperationMode;
pub use printable::{Printable, printable};
pub use request::Request;
pub use spelling::nearest;
