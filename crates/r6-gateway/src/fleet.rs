//! The robots of the gateway: one task and one connection each.
//!
//! - [`station`]: what the gateway knows of one robot, its seat, and what waits for the disk.
//! - [`config`]: how one robot is looked after.
//! - [`roster`]: adds, changes and removes robots while the others go on.
//! - [`roads`]: how connections to robots are made.
//! - [`link`]: the task that keeps the connection and reads the values.
//! - [`record`]: the task that keeps the values and what happens.
//! - [`observe`]: what happens, from the values.
//! - [`command`]: leases, commands, stops and the acceptance of another robot.
//! - [`run`]: runs programs.
//! - [`panel`]: acts at the panel of a virtual robot.
//! - [`camera`]: who may send points as which camera, and what it sends; [`photos`]: what it is asked for.
//! - [`query`]: asks the robot for values that are not read again and again.
//! - [`counts`]: what happened, counted.
//! - [`alarms`]: the alarms of a robot, acknowledged and shelved; [`desk`] has them and saves them.
//! - [`clerk`]: the task that ends leases in time, and writes down what need not be written first.

pub mod address;
mod alarms;
pub mod camera;
pub mod clerk;
pub mod command;
pub mod config;
pub mod counts;
pub mod desk;
pub mod group;
pub mod guard;
mod held;
pub mod link;
mod observe;
pub mod panel;
pub mod photos;
pub mod query;
mod record;
pub mod roads;
pub mod roster;
pub mod run;
pub mod send;
pub mod station;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::time::Duration;

use r6_api::gateway::LeaseEnd;
use tokio::sync::{Mutex as AsyncMutex, watch};
use tokio::task::JoinHandle;

use crate::core::live::follower::Top;
use crate::core::name::RobotName;
use crate::fleet::config::RobotConfig;
use crate::fleet::station::{Kept, Shared, Station, Term};
use crate::live::far::Shown;

/// How long the task of a robot may take to end, once a run is over. It waits for commands for 3 s and for a
/// stop for 17 s, or writes for 5 s.
const END: Duration = Duration::from_secs(25);

/// All robots, by their names.
#[derive(Debug)]
pub struct Fleet {
    posts: RwLock<BTreeMap<RobotName, Post>>,
    shared: Arc<Shared>,
    /// Whether the gateway has ended. Locked while robots are added, changed or removed.
    ended: AsyncMutex<bool>,
}

/// One robot and its tasks.
#[derive(Debug)]
struct Post {
    station: Arc<Station>,
    /// `None` while the robot is configured anew.
    link: Option<Work>,
    clerk: Work,
}

/// A task that can be told to end.
#[derive(Debug)]
struct Work {
    end: watch::Sender<bool>,
    task: JoinHandle<()>,
}

impl Work {
    fn start<T: Future<Output = ()> + Send + 'static>(
        shared: &Shared,
        work: impl FnOnce(watch::Receiver<bool>) -> T,
    ) -> Self {
        let (end, ends) = watch::channel(false);
        Self { end, task: shared.spawn(work(ends)) }
    }

    /// Ends it in order, or after [`END`] without.
    async fn end(mut self) {
        self.end.send_replace(true);
        if tokio::time::timeout(END, &mut self.task).await.is_err() {
            tracing::warn!("the task of a robot did not end in time");
            self.task.abort();
        }
    }
}

impl Post {
    /// `owes_stop`: a list of a run of an earlier start may still be at the robot.
    fn start(config: RobotConfig, saved: Kept, owes_stop: bool, term: Term, shared: &Arc<Shared>) -> Self {
        let station = Arc::new(Station::new(config, saved, term, Arc::clone(shared)));
        if owes_stop {
            station.seat(|seat, _| seat.owe_stop());
        }
        let link = Work::start(shared, |end| link::keep(Arc::clone(&station), end));
        let clerk = Work::start(shared, |end| clerk::work(Arc::clone(&station), end));
        Self { station, link: Some(link), clerk }
    }

    /// Ends the robot at the gateway, for this cause: no new command, then the end of a run, which stops the
    /// arm, the outcomes of commands that are under way, the connection, the last records. Without a run, the
    /// arm goes on with what it does.
    async fn end(self, cause: LeaseEnd) {
        self.station.seat(|seat, _| seat.close(cause));
        self.station.run_is_over().await;
        if let Some(link) = self.link {
            link.end().await;
        }
        self.station.finish_stops().await;
        self.clerk.end().await;
    }
}

impl Fleet {
    /// Starts to look after these robots, each as it was saved. `owed`: the robots for which a stop is owed.
    pub fn start(robots: Vec<(Kept, RobotConfig)>, owed: &BTreeSet<RobotName>, shared: Arc<Shared>) -> Self {
        let post = |(saved, config): (Kept, RobotConfig)| {
            let owes_stop = owed.contains(&config.name);
            let term = Term::alone(shared.keeper.clone());
            (config.name.clone(), Post::start(config, saved, owes_stop, term, &shared))
        };
        let posts = RwLock::new(robots.into_iter().map(post).collect());
        Self { posts, shared, ended: AsyncMutex::new(false) }
    }

    /// The robot with this name.
    pub fn station(&self, name: &str) -> Option<Arc<Station>> {
        let name = RobotName::new(name)?;
        self.read().get(&name).map(|post| Arc::clone(&post.station))
    }

    /// All robots, in the order of their names.
    pub fn stations(&self) -> Vec<Arc<Station>> {
        self.read().values().map(|post| Arc::clone(&post.station)).collect()
    }

    /// All robots, in the order of their names, and how far the numbers have come, of the same moment; with
    /// those of other gateways, or without.
    pub fn shown_now(&self, with_far: bool) -> (Top, Vec<Arc<dyn Shown>>) {
        let posts = self.read();
        let far = self.shared.far.read();
        let mut shown: BTreeMap<&str, Arc<dyn Shown>> = BTreeMap::new();
        if with_far {
            shown.extend(far.iter().map(|(name, far)| (name.as_str(), Arc::clone(far) as Arc<dyn Shown>)));
        }
        // A robot of this gateway takes the place of what others tell of it.
        let here = posts.iter();
        shown.extend(here.map(|(name, post)| (name.as_str(), Arc::clone(&post.station) as Arc<dyn Shown>)));
        (self.shared.top(), shown.into_values().collect())
    }

    /// Ends all robots at the gateway. Arms that a run moves are stopped; the others go on with what they do.
    pub async fn end(&self) {
        *self.ended.lock().await = true;
        let posts = std::mem::take(&mut *self.write());
        let ends = posts.into_values().map(|post| post.end(LeaseEnd::GatewayEnded));
        futures_util::future::join_all(ends).await;
    }

    /// Looks after a robot that this gateway has taken.
    pub fn take_in(&self, saved: Kept, config: RobotConfig, owes_stop: bool, term: Term) {
        let name = config.name.clone();
        let post = Post::start(config, saved, owes_stop, term, &self.shared);
        {
            let mut posts = self.write();
            post.station.appear();
            posts.insert(name, post);
        }
        self.shared.wake_readers();
    }

    /// Takes a robot out of the list.
    fn take_from_list(&self, name: &RobotName) -> Option<Post> {
        let mut posts = self.write();
        let post = posts.remove(name);
        if post.is_some() {
            self.shared.note_removal();
        }
        post
    }

    /// Lets a robot go, in order, until this is over, because another gateway may have it then. An arm that a
    /// run moves is stopped. What has not ended by then is broken off, and the robot has no connection any
    /// more.
    pub async fn let_go(&self, name: &RobotName, cause: LeaseEnd, over: impl Future<Output = ()>) {
        let Some(post) = self.take_from_list(name) else { return };
        self.shared.wake_readers();
        let station = Arc::clone(&post.station);
        let works = post.link.iter().chain([&post.clerk]);
        let aborts: Vec<_> = works.map(|work| work.task.abort_handle()).collect();
        tokio::select! {
            () = post.end(cause) => {}
            () = over => {
                tracing::error!(robot = %name, "what was under way at it did not end in time: its connection is closed");
            }
        }
        aborts.iter().for_each(tokio::task::AbortHandle::abort);
        station.cut(cause);
        // The robot is not held up for them.
        self.shared.spawn(async move { station.write_last().await });
    }

    fn read(&self) -> RwLockReadGuard<'_, BTreeMap<RobotName, Post>> {
        self.posts.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, BTreeMap<RobotName, Post>> {
        self.posts.write().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc;

    use tokio::runtime::Builder;

    use super::*;
    use crate::fleet::roads::Roads;
    use crate::store::{Keeper, Memory};

    #[test]
    fn a_robot_that_a_caller_adds_does_not_run_on_the_threads_for_callers() {
        let runtime = Builder::new_multi_thread().worker_threads(1).thread_name("robots").build().unwrap();
        let keeper = Keeper::start(Memory::default()).unwrap();
        let shared = runtime.block_on(async { Shared::new(keeper, Roads::Tcp, None, 0) });
        let (named, name) = mpsc::channel();
        let note = move || named.send(std::thread::current().name().map(str::to_owned)).unwrap();
        let callers = Builder::new_current_thread().build().unwrap();
        callers.block_on(async { Work::start(&shared, |_end| async move { note() }) });
        let ran = name.recv_timeout(Duration::from_secs(5)).unwrap();
        assert_eq!(ran.as_deref(), Some("robots"));
    }
}
