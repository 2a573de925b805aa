//! The part of the operating system that a blocking connection uses: the time, waiting threads, sockets.
//! Tests simulate it, to control faults and time.
//!
//! `tests/hands/lockstep.rs` has that simulation.

use std::fmt;
use std::io;
use std::net::{Shutdown, TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use crate::hands::connect::refuse_itself;

/// The operations of the system that the threads of a blocking connection use.
pub trait System: fmt::Debug + Send + Sync {
    /// The time since an origin that stays the same. It never goes back.
    fn now(&self) -> Duration;

    /// Makes the calling thread wait for this time.
    fn sleep(&self, time: Duration);

    /// The calling thread.
    fn this_thread(&self) -> Arc<dyn Parked>;

    /// Starts a thread.
    ///
    /// # Errors
    /// The error of the system, if it cannot start one.
    fn spawn(&self, name: &str, what: Box<dyn FnOnce() + Send>) -> io::Result<()>;

    /// Connects to the first address of this host that answers. The time limit covers the addresses, but not
    /// the name lookup.
    ///
    /// # Errors
    /// The error of the last attempt. It counts as a timeout if the time is over by then.
    fn connect(&self, host: &str, port: u16, within: Duration) -> io::Result<Box<dyn Stream>>;
}

/// A thread that waits to be woken.
pub trait Parked: fmt::Debug + Send + Sync {
    /// Waits until [`Self::unpark`] was called since the last wait, or the time is over. It may return
    /// earlier. Only the thread itself calls this.
    fn park(&self, within: Option<Duration>);

    /// Ends the wait, or the next one.
    fn unpark(&self);
}

/// A connected socket that several threads use at once.
pub trait Stream: fmt::Debug + Send + Sync {
    /// Waits for bytes until the timeout. Works as [`io::Read::read`] of a [`TcpStream`].
    ///
    /// # Errors
    /// The errors of that function: of kind `WouldBlock` (on Windows also `TimedOut`) if nothing came in
    /// time.
    fn read(&self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Reads without waiting. No other thread reads or writes meanwhile.
    ///
    /// # Errors
    /// Of kind `WouldBlock` if no bytes are there.
    fn read_now(&self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Writes as many bytes as there is room for. Waits for room until the timeout.
    ///
    /// # Errors
    /// The same errors as [`Self::read`].
    fn write(&self, bytes: &[u8]) -> io::Result<usize>;

    /// Sets how long reading waits.
    ///
    /// # Errors
    /// The error of the system.
    fn set_read_timeout(&self, within: Duration) -> io::Result<()>;

    /// Sets how long writing waits.
    ///
    /// # Errors
    /// The error of the system.
    fn set_write_timeout(&self, within: Duration) -> io::Result<()>;

    /// Shuts down one or both directions. A thread that reads returns if its direction ends.
    ///
    /// # Errors
    /// The error of the system.
    fn shutdown(&self, how: Shutdown) -> io::Result<()>;
}

/// The system that this program runs on.
#[derive(Debug)]
pub(crate) struct Std(Instant);

impl Std {
    /// Starts its time at the present moment.
    pub fn start() -> Self {
        Self(Instant::now())
    }
}

impl System for Std {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }

    fn sleep(&self, time: Duration) {
        thread::sleep(time);
    }

    fn this_thread(&self) -> Arc<dyn Parked> {
        Arc::new(thread::current())
    }

    fn spawn(&self, name: &str, what: Box<dyn FnOnce() + Send>) -> io::Result<()> {
        thread::Builder::new().name(name.to_owned()).spawn(what).map(drop)
    }

    fn connect(&self, host: &str, port: u16, within: Duration) -> io::Result<Box<dyn Stream>> {
        let until = Instant::now().checked_add(within);
        let mut failed = io::Error::new(io::ErrorKind::InvalidInput, "could not resolve to any address");
        for at in (host, port).to_socket_addrs()? {
            let left = until.map_or(within, |until| until.saturating_duration_since(Instant::now()));
            if left.is_zero() {
                break;
            }
            // `set_nodelay`, because otherwise a frame waits for the acknowledgement of the one before, which
            // costs up to 200 ms.
            let made = TcpStream::connect_timeout(&at, left).and_then(|stream| {
                refuse_itself(stream.local_addr()?, stream.peer_addr()?)?;
                stream.set_nodelay(true)?;
                Ok(stream)
            });
            match made {
                Ok(stream) => return Ok(Box::new(stream)),
                Err(error) => failed = error,
            }
        }
        Err(failed)
    }
}

impl Parked for thread::Thread {
    fn park(&self, within: Option<Duration>) {
        match within {
            Some(time) => thread::park_timeout(time),
            None => thread::park(),
        }
    }

    fn unpark(&self) {
        self.unpark();
    }
}

impl Stream for TcpStream {
    fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut stream = self;
        io::Read::read(&mut stream, buffer)
    }

    fn read_now(&self, buffer: &mut [u8]) -> io::Result<usize> {
        self.set_nonblocking(true)?;
        let read = Stream::read(self, buffer);
        self.set_nonblocking(false)?;
        read
    }

    fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        let mut stream = self;
        io::Write::write(&mut stream, bytes)
    }

    fn set_read_timeout(&self, within: Duration) -> io::Result<()> {
        Self::set_read_timeout(self, Some(within))
    }

    fn set_write_timeout(&self, within: Duration) -> io::Result<()> {
        Self::set_write_timeout(self, Some(within))
    }

    fn shutdown(&self, how: Shutdown) -> io::Result<()> {
        Self::shutdown(self, how)
    }
}
