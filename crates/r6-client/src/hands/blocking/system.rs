//! What a blocking connection needs of the system: the time, threads that wait, sockets. Tests simulate it, to make faults and time.

use std::fmt;
use std::io;
use std::net::{Shutdown, TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

/// What the threads of a blocking connection ask for.
pub trait System: fmt::Debug + Send + Sync {
    /// The time since an origin that stays the same. It never goes back.
    fn now(&self) -> Duration;

    /// The calling thread waits for so long.
    fn sleep(&self, time: Duration);

    /// The thread that calls this.
    fn this_thread(&self) -> Arc<dyn Parked>;

    /// Starts a thread.
    ///
    /// # Errors
    /// What the system says if it has none.
    fn spawn(&self, name: &str, what: Box<dyn FnOnce() + Send>) -> io::Result<()>;

    /// Connects to the first address of this host that answers. The time counts for the addresses, not for the name lookup.
    ///
    /// # Errors
    /// What the last attempt failed by. It counts as a time-out if the time is over by then.
    fn connect(&self, host: &str, port: u16, within: Duration) -> io::Result<Box<dyn Stream>>;
}

/// A thread that waits to be woken.
pub trait Parked: fmt::Debug + Send + Sync {
    /// Waits until [`Self::unpark`] was called since the last wait, or the time is over; perhaps less. Only the thread itself calls this.
    fn park(&self, within: Option<Duration>);

    /// Ends the wait, or the next one.
    fn unpark(&self);
}

/// A connected socket, which several threads use at once.
pub trait Stream: fmt::Debug + Send + Sync {
    /// Waits for bytes until the time-out. As [`io::Read::read`] of a [`TcpStream`].
    ///
    /// # Errors
    /// As there: of kind `WouldBlock` (on Windows also `TimedOut`) if nothing came in time.
    fn read(&self, buffer: &mut [u8]) -> io::Result<usize>;

    /// The same without waiting. No other thread reads or writes meanwhile.
    ///
    /// # Errors
    /// Of kind `WouldBlock` if nothing is there.
    fn read_now(&self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Writes what there is room for, and waits for room until the time-out.
    ///
    /// # Errors
    /// As [`Self::read`].
    fn write(&self, bytes: &[u8]) -> io::Result<usize>;

    /// Sets how long reading waits.
    ///
    /// # Errors
    /// What the system says.
    fn set_read_timeout(&self, within: Duration) -> io::Result<()>;

    /// Sets how long writing waits.
    ///
    /// # Errors
    /// What the system says.
    fn set_write_timeout(&self, within: Duration) -> io::Result<()>;

    /// Ends one or both directions. A thread that reads comes back if its direction ends.
    ///
    /// # Errors
    /// What the system says.
    fn shutdown(&self, how: Shutdown) -> io::Result<()>;
}

/// The system that this program runs on.
#[derive(Debug)]
pub(crate) struct Std(Instant);

impl Std {
    /// Its time begins now.
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
            // A frame that waits for the acknowledgement of the one before costs up to 200 ms.
            let made = TcpStream::connect_timeout(&at, left);
            match made.and_then(|stream| stream.set_nodelay(true).map(|()| stream)) {
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
