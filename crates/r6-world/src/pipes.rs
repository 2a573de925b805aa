//! What controllers have written for clients, and what clients have read. Unread bytes show that nothing
//! drives the connection.

use std::collections::{BTreeMap, VecDeque};
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

/// The two addresses of a connection: the controller's and the client's.
pub type Ends = (SocketAddr, SocketAddr);

/// All connections to controllers.
#[derive(Debug, Default)]
pub struct Pipes(BTreeMap<Ends, Pipe>);

/// The direction of one connection to the client.
#[derive(Debug, Default)]
struct Pipe {
    /// The client and the number of its connection; `None` for a camera, and until the client knows that it
    /// is connected.
    reader: Option<(usize, usize)>,
    /// How many bytes were written but not read, by the time when they were written.
    unread: VecDeque<(Duration, usize)>,
    /// Whether one end is gone.
    is_over: bool,
}

impl Pipes {
    /// A client has a new connection.
    pub fn opened(&mut self, ends: Ends, client: usize, number: usize) {
        self.0.entry(ends).or_default().reader = Some((client, number));
    }

    /// A controller wrote bytes.
    pub fn written(&mut self, ends: Ends, bytes: usize, at: Duration) {
        let pipe = self.0.entry(ends).or_default();
        if pipe.is_over {
            return;
        }
        match pipe.unread.back_mut() {
            Some((same, more)) if *same == at => *more += bytes,
            _ => pipe.unread.push_back((at, bytes)),
        }
    }

    /// A client read bytes.
    pub fn read(&mut self, ends: Ends, mut bytes: usize) {
        let Some(pipe) = self.0.get_mut(&ends) else { return };
        while let Some((_, first)) = pipe.unread.front_mut() {
            if *first > bytes {
                *first -= bytes;
                return;
            }
            bytes -= *first;
            pipe.unread.pop_front();
        }
    }

    /// A client closed its end.
    pub fn closed(&mut self, ends: Ends) {
        self.0.insert(ends, Pipe { is_over: true, ..Pipe::default() });
    }

    /// A controller is gone at once, and its last bytes are lost.
    pub fn lost(&mut self, controller: IpAddr) {
        let its = self.0.iter_mut().filter(|((near, _), _)| near.ip() == controller);
        its.for_each(|(_, pipe)| *pipe = Pipe { is_over: true, ..Pipe::default() });
    }

    /// The connections of a client with unread bytes: the number of each, and when its oldest unread byte was
    /// written.
    pub fn unread(&self, client: usize) -> impl Iterator<Item = (usize, Duration)> + '_ {
        self.0.values().filter_map(move |pipe| {
            let (reader, number) = pipe.reader?;
            let (oldest, _) = pipe.unread.front()?;
            (reader == client).then_some((number, *oldest))
        })
    }
}
