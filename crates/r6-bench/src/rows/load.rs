//! Keeps a server busy: several connections with many requests in flight, each answered in order.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Instant;

use super::echo;
use crate::measure::{SLICE, processor_time_of};
use crate::serve::Running;

/// The number of connections, and of requests in flight on each.
const CONNECTIONS: usize = 16;
pub const IN_FLIGHT: usize = 16;

/// Connections with many requests in flight.
pub struct Load {
    process: u32,
    streams: Vec<TcpStream>,
    batch: Vec<u8>,
    /// A byte that occurs once in each reply.
    mark: u8,
}

impl Load {
    /// Sends queries to one of our servers, and runs one warm-up slice.
    pub fn of_queries(server: &Running) -> Self {
        // A reply is one object, and its texts contain no brace.
        Self::of(server.process(), server.address, echo::query_bytes().as_bytes(), b'}')
    }

    /// Repeats one request to the server in the process `process`. Each reply has the byte `mark` once.
    pub fn of(process: u32, address: SocketAddr, request: &[u8], mark: u8) -> Self {
        let streams = (0..CONNECTIONS).map(|_| connect(address)).collect();
        let mut load = Self { process, streams, batch: request.repeat(IN_FLIGHT), mark };
        // A warm-up slice.
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
