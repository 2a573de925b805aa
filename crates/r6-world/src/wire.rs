//! The wires of a world: TCP of the simulated network, observed at the client's end.

use std::fmt;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};

use r6_client::Connect;
use r6_sim::Wire;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use turmoil::net::{TcpListener, TcpStream};

use crate::fault::Class;
use crate::pipes::Ends;
use crate::shared::{Shared, now};

/// The port that controllers listen on.
pub const PORT: u16 = 9760;

/// The port that cameras listen on.
pub const CAMERA_PORT: u16 = 9000;

/// The owner of this end of a wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// A client of the plan.
    Client(usize),
    /// A camera of the plan.
    Camera(usize),
}

/// Makes the connections of a client to its robot. For a camera that is dialled, it waits for the robot.
pub struct Dialler {
    /// The shared state.
    pub shared: Shared,
    /// The end that dials.
    pub end: End,
    /// The name of the host.
    pub robot: String,
    /// The listener of a camera that is dialled.
    pub listener: Option<TcpListener>,
}

impl fmt::Display for Dialler {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.robot)
    }
}

impl Connect for Dialler {
    type Stream = Tapped;

    async fn connect(&mut self) -> io::Result<Tapped> {
        let robot = self.shared.dials(self.end);
        let stream = match &self.listener {
            Some(listener) => listener.accept().await?.0,
            None => Attempt { dialler: self, robot, is_answered: false }.make().await?,
        };
        let ends = stream.peer_addr().and_then(|peer| Ok((peer, stream.local_addr()?))).ok();
        let number = self.shared.connected(self.end, robot, ends);
        Ok(Tapped { stream, shared: self.shared.clone(), end: self.end, number, ends, waited: false })
    }
}

/// An attempt to connect.
struct Attempt<'d> {
    dialler: &'d Dialler,
    robot: usize,
    is_answered: bool,
}

impl Attempt<'_> {
    async fn make(mut self) -> io::Result<TcpStream> {
        let Dialler { shared, end, .. } = self.dialler;
        if let End::Client(client) = *end {
            let mut state = shared.state();
            if state.lines[client].feels_hold() {
                state.record.strikes(Class::T13);
            }
        }
        let robot = format!("robot-{}", self.robot);
        let made = TcpStream::connect((robot.as_str(), PORT)).await;
        self.is_answered = true;
        let mut state = shared.state();
        let refuses = state.floors[shared.robot_number(*end)].felt.is_in_force("refuse");
        if refuses && made.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::ConnectionRefused) {
            state.record.strikes(Class::T1);
        }
        drop(state);
        made
    }
}

impl Drop for Attempt<'_> {
    /// The attempt timed out.
    fn drop(&mut self) {
        if self.is_answered {
            return;
        }
        let Dialler { shared, end, .. } = self.dialler;
        let mut state = shared.state();
        if state.floors[shared.robot_number(*end)].felt.is_in_force("black-hole") {
            state.record.strikes(Class::T2);
        }
    }
}

/// The client's end of a connection.
pub struct Tapped {
    stream: TcpStream,
    shared: Shared,
    end: End,
    number: usize,
    ends: Option<Ends>,
    /// Whether a read was tried while nothing was read here.
    waited: bool,
}

impl AsyncRead for Tapped {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if self.shared.is_cut(self.end, self.number) {
            self.shared.ended(self.end, self.number, "an end in between");
            return Poll::Ready(Ok(()));
        }
        if self.shared.is_deaf(self.end, self.number, cx) {
            self.waited = true;
            return Poll::Pending;
        }
        let waited = std::mem::take(&mut self.waited);
        let before = buffer.filled().len();
        let mut read = ready!(Pin::new(&mut self.stream).poll_read(cx, buffer));
        let bytes = &buffer.filled()[before..];
        if let Some(ends) = self.ends {
            self.shared.state().pipes.read(ends, bytes.len());
        }
        if bytes.is_empty() && self.is_reset() {
            read = Err(io::ErrorKind::ConnectionReset.into());
        }
        if waited && !bytes.is_empty() {
            self.shared.state().record.strikes(Class::T10);
        }
        match &read {
            Ok(()) if bytes.is_empty() => self.shared.ended(self.end, self.number, "an end"),
            Ok(()) => self.shared.received(self.end, self.number, bytes),
            Err(_) => self.shared.ended(self.end, self.number, "a reset"),
        }
        Poll::Ready(read)
    }
}

impl Tapped {
    /// The simulated network has no deliberate reset. The controller's end registers one, and the next end of
    /// the connection counts as that reset.
    fn is_reset(&self) -> bool {
        match (self.stream.local_addr(), self.stream.peer_addr()) {
            (Ok(near), Ok(far)) => self.shared.state().resets.remove(&(far, near)),
            _ => false,
        }
    }
}

impl AsyncWrite for Tapped {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        if self.shared.is_cut(self.end, self.number) {
            return Poll::Ready(Err(io::ErrorKind::BrokenPipe.into()));
        }
        let written = ready!(Pin::new(&mut self.stream).poll_write(cx, bytes));
        if let Ok(count) = written {
            self.shared.sent(self.end, self.number, &bytes[..count]);
        }
        Poll::Ready(written)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

impl Drop for Tapped {
    fn drop(&mut self) {
        if let End::Client(client) = self.end {
            self.shared.state().lines[client].has_ended(self.number, now());
        }
        if let Some(ends) = self.ends {
            self.shared.state().pipes.closed(ends);
        }
    }
}

/// The controller's end of a connection.
pub struct Served {
    /// The connection.
    pub stream: TcpStream,
    /// The shared state.
    pub shared: Shared,
}

impl Wire for Served {
    fn reset(&mut self) {
        if let (Ok(near), Ok(far)) = (self.stream.local_addr(), self.stream.peer_addr()) {
            self.shared.state().resets.insert((near, far));
        }
    }
}

impl AsyncRead for Served {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(cx, buffer)
    }
}

impl AsyncWrite for Served {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let written = ready!(Pin::new(&mut self.stream).poll_write(cx, bytes));
        if let (Ok(count), Ok(near), Ok(far)) = (&written, self.stream.local_addr(), self.stream.peer_addr())
        {
            self.shared.state().pipes.written((near, far), *count, now());
        }
        Poll::Ready(written)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

/// Every complete object in these bytes, including nested ones, with its start and its end. This includes
/// everything that a reader with other rules for broken frames could take for a frame.
pub fn whole_frames(bytes: &[u8]) -> impl Iterator<Item = (usize, usize)> + '_ {
    let begins = bytes.iter().enumerate().filter(|(_, byte)| **byte == b'{').map(|(at, _)| at);
    begins.filter_map(|begin| Some((begin, begin + length(&bytes[begin..])?)))
}

/// The length of the object at the beginning of the bytes.
fn length(bytes: &[u8]) -> Option<usize> {
    let (mut depth, mut in_text, mut escaped) = (0_u32, false, false);
    for (at, byte) in bytes.iter().enumerate() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if in_text => escaped = true,
            b'"' => in_text = !in_text,
            b'{' | b'[' if !in_text => depth += 1,
            b'}' | b']' if !in_text => {
                depth -= 1;
                if depth == 0 {
                    return Some(at + 1);
                }
            }
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_objects_are_found_wherever_they_begin() {
        let found = |text: &str| {
            whole_frames(text.as_bytes()).map(|(from, to)| text[from..to].to_owned()).collect::<Vec<_>>()
        };
        assert_eq!(found(r#"{"a":1}{"b":"}"}"#), [r#"{"a":1}"#, r#"{"b":"}"}"#]);
        assert_eq!(found(r#"{"a":"#), [""; 0]);
        assert!(found(r#"{"a":["x{"b":1}"#).contains(&r#"{"b":1}"#.to_owned()));
    }
}
