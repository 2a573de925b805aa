//! Hashes passwords, on threads that may block.
//!
//! A hash takes 19 MiB and some 20 ms: this is an estimate, and small computers need longer. At most two are
//! computed at once, and one core is left free if there is more than one. A few more hashes wait; others are
//! refused, so that strangers take neither the memory nor all the time of commands. On one core, commands and
//! hashes share it.

use std::sync::Arc;

use argon2::password_hash::phc::{self, Output, ParamsString, Salt};
use argon2::{Algorithm, Argon2, Params, PasswordHasher, PasswordVerifier, Version};
use r6_api::Code;
use r6_api::gateway::Secret;
use tokio::sync::Semaphore;

use crate::core::account::PasswordHash;
use crate::problem::Problem;

/// Memory in KiB, passes and lanes of argon2id, as OWASP advises.
const COST: (u32, u32, u32) = (19 * 1024, 2, 1);

/// How many hashes are computed at once, on a machine with cores enough: 38 MiB.
const AT_ONCE: usize = 2;

/// How many wait for that: with 20 ms for each and one at once, a third of a second.
const MAX_WAITING: usize = 16;

/// How many hashes are computed at once on this machine: a core is left for commands, if there is another.
fn at_once() -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    AT_ONCE.min(cores.saturating_sub(1)).max(1)
}

/// Hashes passwords, some at once.
#[derive(Debug)]
pub struct Passwords {
    argon: Argon2<'static>,
    /// What the password of a user that is not there is compared with: as much work, and never the same.
    of_no_user: String,
    places: Arc<Semaphore>,
    waiting: Semaphore,
}

impl Passwords {
    /// Nothing is hashed yet.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn new() -> Result<Self, Problem> {
        let (memory, passes, lanes) = COST;
        let params = Params::new(memory, passes, lanes, None).map_err(|error| failed(&error))?;
        let of_no_user = of_no_user(&params)?.to_string();
        let argon = Argon2::new(Algorithm::Argon2id, Version::V0x13, params);
        let (places, waiting) = (Arc::new(Semaphore::new(at_once())), Semaphore::new(MAX_WAITING));
        Ok(Self { argon, of_no_user, places, waiting })
    }

    /// The hash of a new password.
    ///
    /// # Errors
    /// `overloaded`: too many wait.
    pub async fn hash(&self, password: Secret) -> Result<PasswordHash, Problem> {
        let salt = random::<16>()?;
        let argon = self.argon.clone();
        let hash = move || argon.hash_password_with_salt(password.0.as_bytes(), &salt);
        let hash = self.run(hash).await?.map_err(|error| failed(&error))?;
        Ok(PasswordHash(hash.to_string()))
    }

    /// Whether this is the password with this hash. Without a hash it never is, and takes as long.
    ///
    /// # Errors
    /// `overloaded`: too many wait.
    pub async fn is(&self, password: Secret, hash: Option<&PasswordHash>) -> Result<bool, Problem> {
        let is_somebody = hash.is_some();
        let hash = hash.map_or_else(|| self.of_no_user.clone(), |hash| hash.0.clone());
        let argon = self.argon.clone();
        let is = move || argon.verify_password(password.0.as_bytes(), hash.as_str()).is_ok();
        Ok(self.run(is).await? && is_somebody)
    }

    /// Runs a job once it has a place. The job holds its place until it is over, also if its caller is gone.
    async fn run<T: Send + 'static>(&self, job: impl FnOnce() -> T + Send + 'static) -> Result<T, Problem> {
        let overloaded = || Problem::new(Code::Overloaded, "too many passwords are being checked: try again");
        let waits = self.waiting.try_acquire().map_err(|_| overloaded())?;
        let place = Arc::clone(&self.places).acquire_owned().await.map_err(|_| overloaded())?;
        drop(waits);
        let work = tokio::task::spawn_blocking(move || {
            let done = job();
            drop(place);
            done
        });
        work.await.map_err(|_| overloaded())
    }
}

/// A hash that no password has: its bytes were drawn.
fn of_no_user(params: &Params) -> Result<phc::PasswordHash, Problem> {
    Ok(phc::PasswordHash {
        algorithm: Algorithm::Argon2id.ident(),
        version: Some(Version::V0x13.into()),
        params: ParamsString::try_from(params).map_err(|error| failed(&error))?,
        salt: Some(Salt::new(&random::<16>()?).map_err(|error| failed(&error))?),
        hash: Some(Output::new(&random::<32>()?).map_err(|error| failed(&error))?),
    })
}

fn random<const N: usize>() -> Result<[u8; N], Problem> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).map_err(|error| failed(&error))?;
    Ok(bytes)
}

fn failed(error: &impl std::fmt::Display) -> Problem {
    Problem::new(Code::StoreUnavailable, format!("passwords cannot be hashed: {error}"))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    use std::time::{Duration, Instant};

    use super::*;

    fn secret(text: &str) -> Secret {
        Secret(text.to_owned())
    }

    #[tokio::test]
    async fn a_hash_is_argon2id_and_fits_one_password() {
        let passwords = Passwords::new().unwrap();
        let hash = passwords.hash(secret("пароль-пароль")).await.unwrap();
        assert!(hash.0.starts_with("$argon2id$v=19$m=19456,t=2,p=1$"), "{}", hash.0);
        assert_ne!(passwords.hash(secret("пароль-пароль")).await.unwrap(), hash, "each has its own salt");
        assert!(passwords.is(secret("пароль-пароль"), Some(&hash)).await.unwrap());
        for wrong in ["", "пароль-парол", "пароль-пароль "] {
            assert!(!passwords.is(secret(wrong), Some(&hash)).await.unwrap(), "{wrong}");
        }
        let broken = PasswordHash("$argon2id$nonsense".to_owned());
        assert!(!passwords.is(secret("пароль-пароль"), Some(&broken)).await.unwrap());
    }

    #[tokio::test]
    async fn a_user_that_is_not_there_takes_as_long() {
        let passwords = Passwords::new().unwrap();
        let hash = passwords.hash(secret("correct horse")).await.unwrap();
        let mut times = [Duration::MAX; 2];
        let is_same = |[there, not_there]: [Duration; 2]| not_there * 2 > there && there * 2 > not_there;
        // The shortest of some, and of more while the machine is busy.
        for round in 0..100 {
            for (time, hash) in times.iter_mut().zip([Some(&hash), None]) {
                let begun = Instant::now();
                assert!(!passwords.is(secret("wrong horse"), hash).await.unwrap());
                *time = begun.elapsed().min(*time);
            }
            if round >= 5 && is_same(times) {
                break;
            }
        }
        assert!(is_same(times), "{times:?}");
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn callers_that_hang_up_do_not_make_more_than_two_run_at_once() {
        let passwords = Arc::new(Passwords::new().unwrap());
        let (running, most) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicUsize::new(0)));
        let open = Arc::new(AtomicBool::new(false));
        let mut callers = Vec::new();
        for _ in 0..1_000 {
            let (passwords, running, most, open) =
                (Arc::clone(&passwords), Arc::clone(&running), Arc::clone(&most), Arc::clone(&open));
            let caller = tokio::spawn(async move {
                let job = move || {
                    let now = running.fetch_add(1, Ordering::SeqCst) + 1;
                    most.fetch_max(now, Ordering::SeqCst);
                    let begun = Instant::now();
                    while !open.load(Ordering::SeqCst) && begun.elapsed() < Duration::from_secs(20) {
                        std::thread::sleep(Duration::from_millis(1));
                    }
                    running.fetch_sub(1, Ordering::SeqCst);
                };
                passwords.run(job).await.is_ok()
            });
            callers.push(caller);
        }
        // All have come: one or two run, some wait, the rest was refused.
        let refused = || callers.iter().filter(|caller| caller.is_finished()).count();
        while refused() < 1_000 - at_once() - MAX_WAITING {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        // They hang up, and others come.
        for caller in callers {
            caller.abort();
            drop(caller.await);
        }
        let late = (0..8).map(|_| passwords.is(secret("late"), None));
        let late = tokio::time::timeout(Duration::from_millis(200), futures_util::future::join_all(late));
        assert!(late.await.is_err(), "their jobs still have the places");
        open.store(true, Ordering::SeqCst);
        assert!(!passwords.is(secret("later"), None).await.unwrap());
        assert_eq!(most.load(Ordering::SeqCst), at_once());
    }
}
