//! A handle on the thread that owns the store (`keeper/work.rs`).

mod append;
mod work;

use std::thread;

use r6_api::gateway::{AuditRecord, Run};
use tokio::sync::mpsc::error::TrySendError;
use tokio::sync::mpsc::{Sender, channel};
use tokio::sync::oneshot;

use self::work::keep;
#[cfg(feature = "simulation")]
use self::work::keep_in_task;
use super::commands::{KeptCommand, NewCommand, Noted};
use super::runs::{Begun, KeptRun, NewRun};
use super::{
    Author, Ends, Entry, Heads, Kept, LibraryError, Link, NewToken, NewVersion, Store, StoreError,
    StoredRobot, StoredSettings, StoredUser, Token, UserChange,
};
use crate::core::account::Decided;
use crate::core::alarms;
use crate::core::library::{Condition, ProgramName};
use crate::core::name::RobotName;
use crate::core::owner::Claim;
use crate::core::seat::Saved;

/// How many jobs wait for the store. At some hundred commits a second, more would wait for seconds.
const MAX_WAITING: usize = 1024;

type Answer<T, E = StoreError> = oneshot::Sender<Result<T, E>>;

enum Job {
    Append(Vec<AuditRecord>, Answer<u64>),
    Entries(u64, usize, Answer<Vec<Entry>>),
    Ends(Answer<Ends>),
    Heads(Answer<Heads>),
    PutHead(String, Answer<()>),
    Cut(u64, String, Answer<()>),
    Tokens(Answer<Vec<Token>>),
    AddToken(NewToken, Author, Answer<i64>),
    RevokeToken(i64, Author, Answer<bool>),
    Users(Answer<Vec<StoredUser>>),
    ChangeUser(Box<UserChange>, Author, Answer<(Decided, u64)>),
    PutLink(Link, Author, Answer<()>),
    Link([u8; 32], u64, Answer<Option<Link>>),
    Seat(RobotName, Answer<Saved>),
    SaveSeat(RobotName, Saved, Answer<()>),
    Alarms(RobotName, Answer<alarms::Saved>),
    SaveAlarms(RobotName, Box<alarms::Saved>, Vec<AuditRecord>, Answer<()>),
    Settings(Answer<Option<StoredSettings>>),
    PutSettings(StoredSettings, AuditRecord, Answer<()>),
    PutRobot(StoredRobot, AuditRecord, Answer<()>),
    RemoveRobot(RobotName, Vec<AuditRecord>, Answer<()>),
    Programs(Answer<Vec<Kept>>),
    ProgramVersions(ProgramName, Answer<Vec<Kept>>),
    Program(ProgramName, Option<u64>, Answer<Option<(Kept, String)>>),
    PutProgram(NewVersion, Condition, Answer<Kept, LibraryError>),
    RemoveProgram(ProgramName, Condition, Author, Answer<(), LibraryError>),
    BeginRun(Box<NewRun>, Answer<Begun>),
    RunOfKey(String, String, u64, Answer<Option<KeptRun>>),
    Run(RobotName, u64, Answer<Option<KeptRun>>),
    AnswerRun(u64, String, Answer<()>),
    EndRun(Box<Run>, bool, Vec<AuditRecord>, Answer<()>),
    OwedStops(Answer<Vec<RobotName>>),
    ForgetOwedStop(RobotName, Answer<()>),
    BeginCommand(Box<NewCommand>, Answer<Noted>),
    CommandOfKey(String, String, u64, Answer<Option<KeptCommand>>),
    EndCommand(u64, String, Box<AuditRecord>, Answer<()>),
    Work(Work),
    End(Answer<()>),
}

/// Several things in one turn of the thread.
type Work = Box<dyn FnOnce(&mut dyn Store) + Send>;

/// A job, and what it is about if a gateway has that for a term.
type Asked = (Option<Claim>, Job);

/// A handle on the thread of the store. The thread ends with [`Keeper::end`] or the last handle, after all
/// that was asked for.
#[derive(Clone)]
pub struct Keeper {
    jobs: Sender<Asked>,
    /// What is asked for with this handle is about this, and is written only while the claim holds.
    claim: Option<Claim>,
}

impl std::fmt::Debug for Keeper {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Keeper").finish_non_exhaustive()
    }
}

impl Keeper {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(store: impl Store + 'static) -> std::io::Result<Self> {
        let (jobs, waiting) = channel(MAX_WAITING);
        thread::Builder::new().name("store".to_owned()).spawn(move || keep(store, waiting))?;
        Ok(Self { jobs, claim: None })
    }

    /// A handle for what is about a robot, or the hall, in one term: nothing is written once another
    /// gateway has it.
    #[must_use]
    pub fn under(&self, claim: Claim) -> Self {
        Self { jobs: self.jobs.clone(), claim: Some(claim) }
    }

    /// What has to hold so that this handle writes.
    #[must_use]
    pub fn claim(&self) -> Option<&Claim> {
        self.claim.as_ref()
    }

    /// Does several things in one turn of the thread.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn work<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut dyn Store) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        // A caller that has gone needs no answer.
        self.ask(|answer| Job::Work(Box::new(move |store| drop(answer.send(work(store)))))).await
    }

    /// Does the work of the thread in a task, where a simulation has no threads. Each job takes `takes`
    /// before it is done at once.
    #[cfg(feature = "simulation")]
    pub fn in_task(
        store: impl Store + 'static,
        takes: impl Fn() -> std::time::Duration + Send + 'static,
    ) -> Self {
        let (jobs, waiting) = channel(MAX_WAITING);
        tokio::spawn(keep_in_task(store, takes, waiting));
        Self { jobs, claim: None }
    }

    /// As [`Store::append`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn append(&self, records: Vec<AuditRecord>) -> Result<u64, StoreError> {
        self.ask(|answer| Job::Append(records, answer)).await
    }

    /// As [`Store::entries`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn entries(&self, after: u64, most: usize) -> Result<Vec<Entry>, StoreError> {
        self.ask(|answer| Job::Entries(after, most, answer)).await
    }

    /// As [`Store::ends`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn ends(&self) -> Result<Ends, StoreError> {
        self.ask(Job::Ends).await
    }

    /// As [`Store::heads`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn heads(&self) -> Result<Heads, StoreError> {
        self.ask(Job::Heads).await
    }

    /// As [`Store::put_head`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn put_head(&self, note: String) -> Result<(), StoreError> {
        self.ask(|answer| Job::PutHead(note, answer)).await
    }

    /// As [`Store::cut`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn cut(&self, until: u64, note: String) -> Result<(), StoreError> {
        self.ask(|answer| Job::Cut(until, note, answer)).await
    }

    /// As [`Store::tokens`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn tokens(&self) -> Result<Vec<Token>, StoreError> {
        self.ask(Job::Tokens).await
    }

    /// As [`Store::add_token`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn add_token(&self, token: NewToken, author: Author) -> Result<i64, StoreError> {
        self.ask(|answer| Job::AddToken(token, author, answer)).await
    }

    /// As [`Store::revoke_token`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn revoke_token(&self, number: i64, author: Author) -> Result<bool, StoreError> {
        self.ask(|answer| Job::RevokeToken(number, author, answer)).await
    }

    /// As [`Store::users`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn users(&self) -> Result<Vec<StoredUser>, StoreError> {
        self.ask(Job::Users).await
    }

    /// As [`Store::change_user`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn change_user(&self, change: UserChange, by: Author) -> Result<(Decided, u64), StoreError> {
        self.ask(|answer| Job::ChangeUser(Box::new(change), by, answer)).await
    }

    /// As [`Store::put_link`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn put_link(&self, link: Link, author: Author) -> Result<(), StoreError> {
        self.ask(|answer| Job::PutLink(link, author, answer)).await
    }

    /// As [`Store::link`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn link(&self, hash: [u8; 32], now: u64) -> Result<Option<Link>, StoreError> {
        self.ask(|answer| Job::Link(hash, now, answer)).await
    }

    /// As [`Store::seat`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn seat(&self, robot: RobotName) -> Result<Saved, StoreError> {
        self.ask(|answer| Job::Seat(robot, answer)).await
    }

    /// As [`Store::alarms`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn alarms(&self, robot: RobotName) -> Result<alarms::Saved, StoreError> {
        self.ask(|answer| Job::Alarms(robot, answer)).await
    }

    /// As [`Store::save_alarms`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn save_alarms(
        &self,
        robot: RobotName,
        saved: alarms::Saved,
        records: Vec<AuditRecord>,
    ) -> Result<(), StoreError> {
        self.ask(|answer| Job::SaveAlarms(robot, Box::new(saved), records, answer)).await
    }

    /// As [`Store::settings`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn settings(&self) -> Result<Option<StoredSettings>, StoreError> {
        self.ask(Job::Settings).await
    }

    /// As [`Store::put_settings`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn put_settings(&self, new: StoredSettings, record: AuditRecord) -> Result<(), StoreError> {
        self.ask(|answer| Job::PutSettings(new, record, answer)).await
    }

    /// As [`Store::put_robot`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn put_robot(&self, robot: StoredRobot, record: AuditRecord) -> Result<(), StoreError> {
        self.ask(|answer| Job::PutRobot(robot, record, answer)).await
    }

    /// As [`Store::remove_robot`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn remove_robot(&self, name: RobotName, records: Vec<AuditRecord>) -> Result<(), StoreError> {
        self.ask(|answer| Job::RemoveRobot(name, records, answer)).await
    }

    /// As [`Store::save_seat`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn save_seat(&self, robot: RobotName, saved: Saved) -> Result<(), StoreError> {
        self.ask(|answer| Job::SaveSeat(robot, saved, answer)).await
    }

    /// As [`Store::programs`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn programs(&self) -> Result<Vec<Kept>, StoreError> {
        self.ask(Job::Programs).await
    }

    /// As [`Store::program_versions`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn program_versions(&self, name: ProgramName) -> Result<Vec<Kept>, StoreError> {
        self.ask(|answer| Job::ProgramVersions(name, answer)).await
    }

    /// As [`Store::program`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn program(
        &self,
        name: ProgramName,
        version: Option<u64>,
    ) -> Result<Option<(Kept, String)>, StoreError> {
        self.ask(|answer| Job::Program(name, version, answer)).await
    }

    /// As [`Store::put_program`].
    ///
    /// # Errors
    /// [`LibraryError`].
    pub async fn put_program(&self, new: NewVersion, condition: Condition) -> Result<Kept, LibraryError> {
        self.ask(|answer| Job::PutProgram(new, condition, answer)).await
    }

    /// As [`Store::remove_program`].
    ///
    /// # Errors
    /// [`LibraryError`].
    pub async fn remove_program(
        &self,
        name: ProgramName,
        condition: Condition,
        by: Author,
    ) -> Result<(), LibraryError> {
        self.ask(|answer| Job::RemoveProgram(name, condition, by, answer)).await
    }

    /// As [`Store::begin_run`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn begin_run(&self, new: NewRun) -> Result<Begun, StoreError> {
        self.ask(|answer| Job::BeginRun(Box::new(new), answer)).await
    }

    /// As [`Store::run_of_key`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn run_of_key(
        &self,
        caller: String,
        key: String,
        since: u64,
    ) -> Result<Option<KeptRun>, StoreError> {
        self.ask(|answer| Job::RunOfKey(caller, key, since, answer)).await
    }

    /// As [`Store::run`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn run(&self, robot: RobotName, id: u64) -> Result<Option<KeptRun>, StoreError> {
        self.ask(|answer| Job::Run(robot, id, answer)).await
    }

    /// As [`Store::answer_run`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn answer_run(&self, id: u64, text: String) -> Result<(), StoreError> {
        self.ask(|answer| Job::AnswerRun(id, text, answer)).await
    }

    /// As [`Store::end_run`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn end_run(&self, run: Run, owed: bool, records: Vec<AuditRecord>) -> Result<(), StoreError> {
        self.ask(|answer| Job::EndRun(Box::new(run), owed, records, answer)).await
    }

    /// As [`Store::owed_stops`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn owed_stops(&self) -> Result<Vec<RobotName>, StoreError> {
        self.ask(Job::OwedStops).await
    }

    /// As [`Store::forget_owed_stop`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn forget_owed_stop(&self, robot: RobotName) -> Result<(), StoreError> {
        self.ask(|answer| Job::ForgetOwedStop(robot, answer)).await
    }

    /// As [`Store::begin_command`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn begin_command(&self, new: NewCommand) -> Result<Noted, StoreError> {
        self.ask(|answer| Job::BeginCommand(Box::new(new), answer)).await
    }

    /// As [`Store::command_of_key`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn command_of_key(
        &self,
        caller: String,
        key: String,
        since: u64,
    ) -> Result<Option<KeptCommand>, StoreError> {
        self.ask(|answer| Job::CommandOfKey(caller, key, since, answer)).await
    }

    /// As [`Store::end_command`].
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn end_command(
        &self,
        intent: u64,
        answer: String,
        outcome: AuditRecord,
    ) -> Result<(), StoreError> {
        self.ask(|to| Job::EndCommand(intent, answer, Box::new(outcome), to)).await
    }

    /// Ends the thread after all that was asked for, and closes the store: what its log has is in its file
    /// then. Nothing can be asked for any more.
    ///
    /// # Errors
    /// [`StoreError::Closed`]: it has ended before.
    pub async fn end(&self) -> Result<(), StoreError> {
        let (answer, answered) = oneshot::channel();
        self.jobs.send((None, Job::End(answer))).await.map_err(|_| StoreError::Closed)?;
        answered.await.unwrap_or(Err(StoreError::Closed))
    }

    async fn ask<T, E: From<StoreError>>(&self, job: impl FnOnce(Answer<T, E>) -> Job) -> Result<T, E> {
        let (answer, answered) = oneshot::channel();
        self.jobs.try_send((self.claim.clone(), job(answer))).map_err(|error| match error {
            TrySendError::Full(_) => {
                StoreError::Unavailable(format!("{MAX_WAITING} writes wait for the disk"))
            }
            TrySendError::Closed(_) => StoreError::Closed,
        })?;
        answered.await.unwrap_or_else(|_| Err(StoreError::Closed.into()))
    }
}
