//! One TCP connection to a virtual controller.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use r6_controller::{ConnectionId, Level};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::Notify;
use tracing::{debug, trace};

use crate::camera::Camera;
use crate::handle::ControllerHandle;

/// One read of the socket.
const READ_BYTES: usize = 4096;

/// How long a write may be stuck before the connection is given up: the peer does not read.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);

/// Why a connection ended.
enum End {
    /// The peer closed it.
    Closed,
    /// It has to be reset: the controller would.
    Reset,
}

/// Serves a connection until it ends.
pub(crate) async fn serve(controller: ControllerHandle, mut stream: TcpStream) {
    let (id, notice) = controller.connect();
    debug!(connection = id.number(), "connected");
    let how = converse(&controller, &mut stream, id, &notice).await;
    debug!(connection = id.number(), how, "over");
    controller.disconnect(id);
}

/// Serves a connection that was opened to a camera, until it ends.
pub(crate) async fn serve_camera(controller: &ControllerHandle, mut stream: TcpStream, camera: Camera) {
    let (id, notice) = controller.connect_camera(camera.cam_id);
    controller.tell(Some(id), Level::Info, format!("connected to {camera}"));
    let how = converse(controller, &mut stream, id, &notice).await;
    controller.disconnect(id);
    controller.tell(Some(id), Level::Warning, format!("{camera} is lost: {how}"));
}

/// Serves a connection until it ends, and tells how it did.
async fn converse(
    controller: &ControllerHandle,
    stream: &mut TcpStream,
    id: ConnectionId,
    notice: &Arc<Notify>,
) -> String {
    match run(controller, stream, id, notice).await {
        Ok(End::Closed) => "closed by the peer".to_owned(),
        Ok(End::Reset) => {
            reset(stream);
            "reset".to_owned()
        }
        Err(error) => error.to_string(),
    }
}

async fn run(
    controller: &ControllerHandle,
    stream: &mut TcpStream,
    id: ConnectionId,
    notice: &Arc<Notify>,
) -> io::Result<End> {
    // Each frame leaves at once and by itself: clients read with one call and small buffers.
    stream.set_nodelay(true)?;
    let mut input = vec![0; READ_BYTES];
    let mut frame = Vec::new();
    // A peer may close its own half and still read, as `nc -N` does: what is held back for it is sent first.
    let mut half_closed = false;
    loop {
        while next_frame(controller, id, &mut frame) {
            controller.kept(id).await;
            trace!(connection = id.number(), frame = %String::from_utf8_lossy(&frame), "sent");
            tokio::time::timeout(WRITE_TIMEOUT, stream.write_all(&frame)).await??;
        }
        if controller.look(|controller, _| controller.is_over(id)) {
            return Ok(End::Reset);
        }
        let due = controller.next_transmit(id);
        if half_closed && due.is_none() {
            return Ok(End::Closed);
        }
        let delay = due.unwrap_or(Duration::MAX);
        tokio::select! {
            read = stream.read(&mut input), if !half_closed => {
                let bytes = input.get(..read?).unwrap_or_default();
                half_closed = bytes.is_empty();
                trace!(connection = id.number(), bytes = %String::from_utf8_lossy(bytes), "received");
                controller.handle_input(id, bytes);
            }
            () = notice.notified() => {}
            () = tokio::time::sleep(delay), if due.is_some() => {}
        }
    }
}

/// Copies the next frame that is due into `frame`.
fn next_frame(controller: &ControllerHandle, id: ConnectionId, frame: &mut Vec<u8>) -> bool {
    frame.clear();
    controller.look(|controller, now| {
        if let Some(next) = controller.poll_transmit(now, id) {
            frame.extend_from_slice(next);
        }
    });
    !frame.is_empty()
}

/// Lets the connection end with a reset instead of an orderly close.
fn reset(stream: &TcpStream) {
    if let Err(error) = socket2::SockRef::from(stream).set_linger(Some(Duration::ZERO)) {
        debug!(%error, "the connection is closed instead of reset");
    }
}
