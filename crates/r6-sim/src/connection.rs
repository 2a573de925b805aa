//! One connection to a virtual controller, over any [`Wire`].

mod faulty;

use std::future::{pending, poll_fn};
use std::io;
use std::pin::Pin;
use std::task::Poll;
use std::time::Duration;

use r6_controller::ConnectionId;
use r6_controller::event::{Detail, ShellEvent};
use r6_traffic::link::Link;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::sync::Notify;
use tracing::{debug, trace};

use crate::camera::Camera;
use crate::handle::{ControllerHandle, Next};
use crate::wire::Wire;

/// How many bytes one read of the socket takes.
const READ_BYTES: usize = 4096;

/// How long a write may be blocked before the connection is given up, because the peer does not read.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);

/// How long a peer has to close its half after we have closed ours.
const HANG_UP_TIME: Duration = Duration::from_secs(2);

/// Why a connection ended.
enum End {
    /// The peer closed it.
    Closed,
    /// It has to be reset, as the controller would do.
    Reset,
    /// It has to be closed in good order, although the peer did not close it.
    HungUp,
}

/// Serves a connection until it ends.
pub(crate) async fn serve<W: Wire>(controller: ControllerHandle, stream: W) {
    let (id, notice) = controller.connect();
    debug!(connection = id.number(), "connected");
    let how = Conversation::new(&controller, stream, id, &notice).converse().await;
    debug!(connection = id.number(), how, "over");
}

/// Serves a connection that was opened to a camera, until it ends.
pub(crate) async fn serve_camera<W: Wire>(controller: &ControllerHandle, stream: W, camera: Camera) {
    let (id, notice) = controller.connect_camera(camera.cam_id);
    controller.tell(Some(id), ShellEvent::CameraConnected { camera: Detail::of(camera) });
    let how = Conversation::new(controller, stream, id, &notice).converse().await;
    let (camera, how) = (Detail::of(camera), Detail::of(how));
    controller.tell(Some(id), ShellEvent::CameraLost { camera, how });
}

/// The state of one connection.
struct Conversation<'c, W> {
    controller: &'c ControllerHandle,
    stream: W,
    id: ConnectionId,
    notice: &'c Notify,
    input: Vec<u8>,
    frame: Vec<u8>,
    /// The peer may close its half and still read, as `nc -N` does. Delayed frames are sent before the
    /// connection is closed.
    half_closed: bool,
    /// The link with its faults, after there were any.
    link: Option<Link>,
    /// The number of link changes that `link` has.
    link_changes: u64,
}

impl<'c, W: Wire> Conversation<'c, W> {
    fn new(controller: &'c ControllerHandle, stream: W, id: ConnectionId, notice: &'c Notify) -> Self {
        let (link_changes, link) = controller.look(|now_is, now| {
            let faults = now_is.link_faults();
            let link = (!faults.is_empty()).then(|| controller.new_link(id, now, faults));
            (now_is.link_changes(), link)
        });
        let (input, frame) = (vec![0; READ_BYTES], Vec::new());
        Self { controller, stream, id, notice, input, frame, half_closed: false, link, link_changes }
    }

    /// Serves the connection until it ends, and returns how it ended.
    async fn converse(mut self) -> String {
        let end = self.run().await;
        if self.link.as_ref().is_none_or(Link::notices_end) {
            self.controller.disconnect(self.id);
        } else {
            self.controller.lose(self.id);
        }
        match end {
            Ok(End::Closed) => "closed by the peer".to_owned(),
            Ok(End::Reset) => {
                self.stream.reset();
                "reset".to_owned()
            }
            Ok(End::HungUp) => {
                hang_up(&mut self.stream, &mut self.input).await;
                "closed".to_owned()
            }
            Err(error) => error.to_string(),
        }
    }

    async fn run(&mut self) -> io::Result<End> {
        loop {
            let end = match self.link.take_if(|link| !link.is_transparent()) {
                None => self.run_whole().await?,
                Some(mut link) => {
                    let end = self.run_faulty(&mut link).await;
                    self.link = Some(link);
                    end?
                }
            };
            if let Some(end) = end {
                return Ok(end);
            }
        }
    }

    /// Serves the connection while its link has no faults; `None` if that may have changed.
    async fn run_whole(&mut self) -> io::Result<Option<End>> {
        loop {
            let (over, due) = loop {
                match self.next_frame() {
                    Next::Frame => {}
                    Next::Nothing { over, due } => break (over, due),
                    Next::LinkChanged => {
                        self.look_at_link();
                        return Ok(None);
                    }
                }
                self.controller.kept(self.id).await;
                trace!(connection = self.id.number(), frame = %String::from_utf8_lossy(&self.frame), "sent");
                write(&mut self.stream, &self.frame).await?;
            };
            if over {
                return Ok(Some(End::Reset));
            }
            if self.half_closed && due.is_none() {
                return Ok(Some(End::Closed));
            }
            // Due events were handled above, so reading input first delays nothing.
            tokio::select! {
                biased;
                read = self.stream.read(&mut self.input), if !self.half_closed => {
                    let bytes = self.input.get(..read?).unwrap_or_default();
                    self.half_closed = bytes.is_empty();
                    trace!(connection = self.id.number(), bytes = %String::from_utf8_lossy(bytes), "received");
                    self.controller.handle_input(self.id, bytes);
                }
                () = self.notice.notified() => {}
                () = after(due) => {}
            }
        }
    }

    fn is_over(&self) -> bool {
        self.controller.look(|controller, _| controller.is_over(self.id))
    }

    /// Copies the next due frame into `self.frame`.
    fn next_frame(&mut self) -> Next {
        self.frame.clear();
        self.controller.next_frame(self.id, self.link_changes, &mut self.frame)
    }

    /// Gives the link the faults that are in force now.
    fn look_at_link(&mut self) {
        let (controller, id) = (self.controller, self.id);
        controller.look(|now_is, now| {
            self.link_changes = now_is.link_changes();
            // Without a link the connection was opened before the faults began.
            let link = self.link.get_or_insert_with(|| controller.new_link(id, now, &[]));
            link.set_faults(now, now_is.link_faults());
        });
    }
}

/// Waits this long; without a time, forever.
async fn after(delay: Option<Duration>) {
    match delay {
        Some(delay) => tokio::time::sleep(delay).await,
        None => pending().await,
    }
}

/// Writes to the peer. A peer that does not read causes a timeout.
async fn write<W: Wire>(stream: &mut W, bytes: &[u8]) -> io::Result<()> {
    // Nearly every frame is written at once, so no timer is needed.
    let written = poll_fn(|cx| match Pin::new(&mut *stream).poll_write(cx, bytes) {
        Poll::Ready(written) => Poll::Ready(written),
        Poll::Pending => Poll::Ready(Ok(0)),
    });
    match bytes.get(written.await?..) {
        Some([]) | None => Ok(()),
        Some(rest) => tokio::time::timeout(WRITE_TIMEOUT, stream.write_all(rest)).await?,
    }
}

/// Closes our half, and waits a little for the peer to close its own. Dropping a socket with unread bytes
/// would reset the connection.
pub(crate) async fn hang_up<W: Wire>(stream: &mut W, input: &mut [u8]) {
    let end = async {
        stream.shutdown().await?;
        while stream.read(input).await? > 0 {}
        io::Result::Ok(())
    };
    match tokio::time::timeout(HANG_UP_TIME, end).await {
        Ok(Ok(())) => {}
        Ok(Err(error)) => debug!(%error, "the peer ended the connection, too, but not in good order"),
        Err(_) => debug!("the peer does not close its half"),
    }
}
