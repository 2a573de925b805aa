//! Driving the connection: a slow, dropped or flooded call does not harm other calls.

use std::future::poll_fn;
use std::io;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::task::{Context, Poll};
use std::time::Duration;

use r6_client::{Connect, Heartbeat, Pushed, Robot, RobotSettings};
use r6_proto::AxisIndex;
use r6_proto::address::Address;
use r6_proto::message::Reading;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, sleep};

use crate::controller::{Wires, asked, settings, soon, values};

/// Polls the call once. While it is kept and not polled, it does not drive the connection.
pub async fn begun<F: Future>(call: Pin<&mut F>) -> bool {
    let mut call = Some(call);
    poll_fn(|cx| Poll::Ready(call.take().is_some_and(|call| call.poll(cx).is_pending()))).await
}

#[tokio::test(start_paused = true)]
async fn a_call_that_is_polled_once_and_kept_holds_up_no_heartbeat() {
    let every = Duration::from_secs(1);
    let settings = RobotSettings { heartbeat: Heartbeat::Managed { every }, ..settings() };
    let (_wires, robot, mut peer) = Wires::with_robot(settings).await;
    let started = Instant::now();
    let mut kept = pin!(robot.query(&[Address::CurMode]));
    assert!(begun(kept.as_mut()).await);
    let mut beats = 0;
    while beats < 5 {
        let frame = peer.any_frame().await;
        beats += u32::from(frame["reqType"] == "heartbreak");
    }
    assert!(started.elapsed() <= every * 4 + Duration::from_millis(20), "{:?}", started.elapsed());
}

#[tokio::test(start_paused = true)]
async fn a_call_that_is_polled_once_and_kept_keeps_no_other_from_its_reply() {
    let (_wires, robot, peer) = Wires::with_robot(settings()).await;
    tokio::spawn(peer.answer_all(|request| Some(values(request, vec!["1"; asked(request).len()].into()))));
    robot.query(&[Address::CurMode]).await.unwrap();
    let (mut kept, mut other) =
        (pin!(robot.query(&[Address::CurMode])), pin!(robot.query(&[Address::CurAlarm])));
    assert!(begun(other.as_mut()).await);
    // This call drove last, so the next bytes wake it.
    assert!(begun(kept.as_mut()).await);
    let read = soon(other).await.unwrap();
    assert_eq!(read.integer(Address::CurAlarm), Some(1));
    assert_eq!(soon(kept).await.unwrap().integer(Address::CurMode), Some(1));
}

#[tokio::test(start_paused = true)]
async fn a_call_that_is_polled_once_and_kept_holds_up_no_subscription_that_begins_later() {
    let (_wires, robot, peer) = Wires::with_robot(settings()).await;
    tokio::spawn(peer.answer_all(|request| {
        (asked(request) != ["axis-0"]).then(|| values(request, vec!["1"; asked(request).len()].into()))
    }));
    robot.query(&[Address::CurMode]).await.unwrap();
    // This call is never answered, so only the other calls can wake it.
    let mut kept = pin!(robot.query(&[Address::Axis(AxisIndex::ALL[0])]));
    assert!(begun(kept.as_mut()).await);
    let every = Duration::from_millis(50);
    let subscription = robot.subscribe(&[Address::CurAlarm], every).unwrap();
    // No call waits for it, but the latest values have to come nevertheless.
    sleep(every).await;
    assert_eq!(subscription.latest().fresh(Address::CurAlarm), Some(&Reading::Integer(1)));
}

#[tokio::test(start_paused = true)]
async fn a_call_that_is_polled_once_and_kept_holds_up_no_news_that_somebody_listens_for() {
    let (_wires, robot, mut peer) = Wires::with_robot(settings()).await;
    let (read, ()) = tokio::join!(robot.query(&[Address::CurMode]), async {
        let request = peer.frame().await;
        peer.send(values(&request, vec!["1"].into())).await;
    });
    read.unwrap();
    let mut kept = pin!(robot.query(&[Address::CurAlarm]));
    assert!(begun(kept.as_mut()).await);
    let mut pushed = robot.pushed();
    peer.send(r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0}"#).await;
    assert!(matches!(soon(pushed.recv()).await, Ok(Pushed::Photo { cam_id: 0 })));
}

#[tokio::test(start_paused = true)]
async fn a_call_that_is_dropped_while_it_drives_leaves_the_reply_to_its_owner() {
    let (_wires, robot, mut peer) = Wires::with_robot(settings()).await;
    let other = robot.clone();
    let reading = tokio::spawn(async move { other.query(&[Address::CurAlarm]).await });
    let request = peer.frame().await;
    {
        let mut dropped = pin!(robot.query(&[Address::CurMode]));
        assert!(begun(dropped.as_mut()).await);
        // Its waker is woken for this reply, but the call is dropped before it looks.
        peer.send(values(&request, ["7"].as_slice().into())).await;
    }
    assert_eq!(soon(reading).await.unwrap().unwrap().integer(Address::CurAlarm), Some(7));
}

#[tokio::test(start_paused = true)]
async fn a_stop_whose_call_is_dropped_at_once_leaves_all_the_same() {
    let (_wires, robot, mut peer) = Wires::with_robot(settings()).await;
    {
        let mut dropped = pin!(robot.stop());
        assert!(begun(dropped.as_mut()).await);
    }
    let frame = soon(peer.frame()).await;
    assert_eq!(frame["cmdData"][0], "actionStop", "{frame}");
}

/// A connection that receives garbage without end, and whose reader never has to wait.
struct Endless {
    reads: Arc<AtomicUsize>,
}

impl AsyncRead for Endless {
    fn poll_read(self: Pin<&mut Self>, _: &mut Context<'_>, into: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        self.reads.fetch_add(1, Ordering::Relaxed);
        into.put_slice(b"[1,2] ");
        Poll::Ready(Ok(()))
    }
}

impl AsyncWrite for Endless {
    fn poll_write(self: Pin<&mut Self>, _: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Poll::Ready(Ok(bytes.len()))
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

struct Garbage(Arc<AtomicUsize>);

impl std::fmt::Display for Garbage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("garbage")
    }
}

impl Connect for Garbage {
    type Stream = Endless;

    async fn connect(&mut self) -> io::Result<Endless> {
        Ok(Endless { reads: Arc::clone(&self.0) })
    }
}

#[tokio::test]
async fn garbage_without_end_keeps_no_other_task_from_its_turn() {
    let (reads, over) = (Arc::<AtomicUsize>::default(), Arc::<AtomicBool>::default());
    let settings = RobotSettings { reply_timeout: Duration::from_secs(3600), ..settings() };
    let robot = Robot::connect_with(Garbage(Arc::clone(&reads)), settings).await.unwrap();
    let (asking, told) = (robot.clone(), Arc::clone(&over));
    let asked = tokio::spawn(async move {
        drop(asking.query(&[Address::CurMode]).await);
        told.store(true, Ordering::Relaxed);
    });
    let mut before = 0;
    for turn in 0..20 {
        sleep(Duration::from_millis(1)).await;
        let now = reads.load(Ordering::Relaxed);
        assert!(turn == 0 || now > before, "it is still read");
        before = now;
    }
    assert!(!over.load(Ordering::Relaxed));
    asked.abort();
}

/// tokio suspends a task that was served very often in one turn. That must not suspend the timer for good.
#[tokio::test(start_paused = true)]
async fn a_caller_that_has_used_up_its_turn_is_told_of_a_time_out_all_the_same() {
    let reply_timeout = Duration::from_millis(300);
    for used in [0, 126, 127, 128, 129, 140] {
        let settings = RobotSettings { reply_timeout, ..settings() };
        let (_wires, robot, _silent) = Wires::with_robot(settings).await;
        let (give, mut take) = tokio::sync::mpsc::unbounded_channel();
        (0..used).for_each(|number| give.send(number).unwrap());
        tokio::task::yield_now().await;
        for _ in 0..used {
            take.recv().await.unwrap();
        }
        let begun = Instant::now();
        soon(robot.query(&[Address::CurMode])).await.unwrap_err();
        assert!(begun.elapsed() < reply_timeout * 4, "{used}: {:?}", begun.elapsed());
    }
}
