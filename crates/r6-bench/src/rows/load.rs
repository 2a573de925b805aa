//! A server kept busy: connections that have many requests under way, each answered in its turn.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Instant;

use super::echo;
use crate::measure::{SLICE, processor_time_of};
use crate::serve::Running;

/// Connections, and requests that are under way on each.
const CONNECTIONS: usize = 16;
pub const IN_FLIGHT: usize = 16;

/// Programs that keep many requests under way.
pub struct Load {
    process: u32,
    streams: Vec<TcpStream>,
    batch: Vec<u8>,
    /// A byte that each reply has once.
    mark: u8,
}

impl Load {
    /// Queries to one of our servers, and one batch of each connection answered.
    pub fn of_queries(server: &Running) -> Self {
        // A reply has one object and no brace in its texts.
        Self::of(server.process(), server.address, echo::query_bytes().as_bytes(), b'}')
    }

    /// One request again and again to the server that this process is; each reply has the byte `mark` once.
    pub fn of(process: u32, address: SocketAddr, request: &[u8], mark: u8) -> Self {
        let streams = (0..CONNECTIONS).map(|_| connect(address)).collect();
        let mut load = Self { process, streams, batch: request.repeat(IN_FLIGHT), mark };
        // Once for warmth.
        load.cost();
        load
    }

    /// Nanoseconds of the server's processor time for each request, over a slice.
    pub fn cost(&mut self) -> Vec<f64> {
        let before = processor_time_of(self.process);
        let begun = Instant::now();
        let mut answered = 0_u32;
        let mut buffer = [0; 1 << 16];
        while begun.elapsed() < SLICE {
            for stream in &mut self.streams {
                stream.write_all(&self.batch).expect("it is read");
            }
            for stream in &mut self.streams {
                let mut waiting = IN_FLIGHT;
                while waiting > 0 {
                    let count = stream.read(&mut buffer).expect("replies");
                    assert!(count > 0, "all is answered");
                    let replies = buffer[..count].iter().filter(|byte| **byte == self.mark).count();
                    waiting = waiting.checked_sub(replies).expect("no more replies than requests");
                    answered += u32::try_from(replies).unwrap_or(0);
                }
            }
        }
        let spent = processor_time_of(self.process) - before;
        vec![spent.as_secs_f64() * 1e9 / f64::from(answered)]
    }
}

fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).expect("it listens");
    stream.set_nodelay(true).expect("small frames leave at once");
    stream
}
