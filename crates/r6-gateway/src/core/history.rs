//! The history of values, without I/O.
//!
//! - [`sample`]: a value of a signal at a time, or why it has no value.
//! - [`change`]: which readings are kept: changes, and a sample now and then that says that nothing changed.
//! - [`block`]: the samples of a signal that are not in a chunk yet.
//! - [`codec`]: the bytes of a chunk: at most 512 samples of one signal.
//! - `series`: the samples of an open block in little memory.
//! - [`tail`]: the bytes that keep the open blocks of a robot.
//! - [`merge`]: chunks that overlap, as one series in the order of time.
//! - [`buckets`]: averages weighted by time.
//! - [`wide`]: buckets put together to wider ones.
//! - [`averages`]: buckets of a day that are kept when its samples are gone.
//! - [`event`]: what was seen to happen.
//! - [`waiting`]: events that wait for the thread of the history.
//! - [`wall`]: the time of day, carried by a clock that does not jump.

pub mod averages;
pub mod block;
pub mod buckets;
mod bytes;
pub mod change;
pub mod codec;
pub mod event;
pub mod merge;
mod packed;
pub mod sample;
mod series;
pub mod tail;
pub mod turns;
pub mod waiting;
pub mod wall;
pub mod wide;
