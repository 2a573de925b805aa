//! How often passwords can be tried, and which failures the audit log tells of.
//!
//! The rule, for a name and the address that it comes from:
//!
//! - The name has signed in from this address before: the two have a count of their own. After 5 failures
//!   each try waits 1, 2, 4 … 30 s. No stranger elsewhere can make this user wait.
//! - Otherwise the address waits 1, 2, 4 … 60 s after 5 failures with any names, and the name waits
//!   1, 2, 4, 8 s after 10 failures from any addresses. So a user at a new address waits some seconds while
//!   somebody tries passwords, and one account can be tried some 10 000 times a day.
//!
//! A user also waits after 10 successes: one each 5 s in the long run, from all addresses together. Each
//! takes 20 ms of a core and a line of the audit log, and a script that signs in without end must not take
//! both.
//!
//! A count is forgotten 15 minutes after its last failure. A name that does not exist is counted like any
//! other. No table grows with what strangers send.

use std::collections::BTreeMap;
use std::net::{IpAddr, Ipv6Addr};
use std::time::Duration;

use r6_proto::time::Instant;
use sha2::{Digest, Sha256};

use crate::core::account::{MAX_ACCOUNTS, UserName};
use crate::core::rate::{self, Rate};

/// A count is forgotten so long after its last failure.
const FORGOTTEN_AFTER: Duration = Duration::from_secs(15 * 60);

/// How many addresses are remembered. Beyond it the address that failed longest ago is forgotten.
/// A stranger with more addresses than this has first tries without end anyway.
const MAX_SOURCES: usize = 1_024;

/// How many counts all names share, so that names that are made up need no memory. Which names share one
/// cannot be known outside.
const ACCOUNT_COUNTS: usize = 1_024;

/// From how many addresses a user is known: a few screens and a computer at home.
const MAX_KNOWN_SOURCES: usize = 4;

/// How many failures cost nothing, and how long the longest wait is.
#[derive(Clone, Copy, Debug)]
struct Limit {
    free: u32,
    longest: Duration,
}

const OF_SOURCE: Limit = Limit { free: 5, longest: Duration::from_secs(60) };
const OF_ACCOUNT: Limit = Limit { free: 10, longest: Duration::from_secs(8) };
const OF_KNOWN: Limit = Limit { free: 5, longest: Duration::from_secs(30) };

/// Successes of one user: some screens at once, then 17 000 a day at most.
const SUCCESSES: rate::Limit = rate::Limit { interval: Duration::from_secs(5), burst: 10 };

#[derive(Clone, Copy, Debug)]
struct Count {
    failures: u32,
    last: Instant,
}

impl Default for Count {
    fn default() -> Self {
        Self { failures: 0, last: Instant::ORIGIN }
    }
}

impl Count {
    /// How long the next try has to wait.
    fn wait(&mut self, now: Instant, limit: Limit) -> Duration {
        if self.last + FORGOTTEN_AFTER <= now {
            self.failures = 0;
        }
        let Some(steps) = self.failures.checked_sub(limit.free) else { return Duration::ZERO };
        // More steps are longer than any limit.
        let pause = Duration::from_secs(1 << steps.min(16)).min(limit.longest);
        (self.last + pause).since(now)
    }

    fn charge(&mut self, now: Instant) {
        self.failures = self.failures.saturating_add(1);
        self.last = now;
    }
}

/// The addresses that one peer can choose from: one of IPv4, 2^64 of IPv6.
fn network(source: IpAddr) -> IpAddr {
    match source.to_canonical() {
        IpAddr::V6(address) => IpAddr::V6(Ipv6Addr::from_bits(address.to_bits() >> 64 << 64)),
        address @ IpAddr::V4(_) => address,
    }
}

/// A try that is under way. It counts as failed until [`SignIns::succeeded`].
#[derive(Debug)]
#[must_use = "it counts as failed"]
pub struct Attempt {
    source: IpAddr,
    charged: Charged,
}

#[derive(Clone, Debug)]
enum Charged {
    /// The own count of name and address.
    Known(UserName),
    /// The counts of the address and of the name.
    Both(usize),
    /// The count of the address.
    Source,
}

/// The counts of failures.
#[derive(Debug)]
pub struct SignIns {
    seed: [u8; 32],
    sources: BTreeMap<IpAddr, Count>,
    accounts: Vec<Count>,
    known: BTreeMap<UserName, Vec<(IpAddr, Count)>>,
    successes: BTreeMap<UserName, Rate>,
}

impl SignIns {
    /// Counts without failures. `seed` is random: it decides which names share a count.
    #[must_use]
    pub fn new(seed: [u8; 32]) -> Self {
        let accounts = vec![Count::default(); ACCOUNT_COUNTS];
        let (sources, known, successes) = Default::default();
        Self { seed, sources, accounts, known, successes }
    }

    /// Begins a try with this name, as its caller wrote it.
    ///
    /// # Errors
    /// It comes too early, and is not counted: how long to wait.
    pub fn begin(&mut self, name: &str, source: IpAddr, now: Instant) -> Result<Attempt, Duration> {
        let source = network(source);
        let user = UserName::new(name);
        let successes = user.as_ref().and_then(|user| self.successes.get(user));
        let wait = successes.map_or(Duration::ZERO, |rate| rate.wait(now, SUCCESSES));
        if !wait.is_zero() {
            return Err(wait);
        }
        if let Some(user) = user
            && let Some(count) = self.known_count(&user, source)
        {
            let wait = count.wait(now, OF_KNOWN);
            if !wait.is_zero() {
                return Err(wait);
            }
            count.charge(now);
            return Ok(Attempt { source, charged: Charged::Known(user) });
        }
        let at = self.account(name);
        let of_source =
            self.sources.get_mut(&source).map_or(Duration::ZERO, |count| count.wait(now, OF_SOURCE));
        let of_account =
            self.accounts.get_mut(at).map_or(Duration::ZERO, |count| count.wait(now, OF_ACCOUNT));
        let wait = of_source.max(of_account);
        if !wait.is_zero() {
            return Err(wait);
        }
        self.count_of(source, now).charge(now);
        if let Some(count) = self.accounts.get_mut(at) {
            count.charge(now);
        }
        Ok(Attempt { source, charged: Charged::Both(at) })
    }

    /// The same for a secret that belongs to no name.
    ///
    /// # Errors
    /// It comes too early, and is not counted: how long to wait.
    pub fn begin_with_secret(&mut self, source: IpAddr, now: Instant) -> Result<Attempt, Duration> {
        let source = network(source);
        let count = self.count_of(source, now);
        let wait = count.wait(now, OF_SOURCE);
        if !wait.is_zero() {
            return Err(wait);
        }
        count.charge(now);
        Ok(Attempt { source, charged: Charged::Source })
    }

    /// The try was no failure. The failures before it still count: who has one password must not get more
    /// tries at others.
    pub fn give_back(&mut self, attempt: &Attempt) {
        let back = |count: &mut Count| count.failures = count.failures.saturating_sub(1);
        match &attempt.charged {
            Charged::Known(user) => drop(self.known_count(user, attempt.source).map(back)),
            Charged::Both(at) => {
                self.sources.get_mut(&attempt.source).map(back);
                self.accounts.get_mut(*at).map(back);
            }
            Charged::Source => drop(self.sources.get_mut(&attempt.source).map(back)),
        }
    }

    /// The user signed in: from now on the two have a count of their own.
    pub fn succeeded(&mut self, attempt: &Attempt, user: &UserName, now: Instant) {
        self.was_right(attempt, user, now);
        self.know(user, attempt.source, now);
    }

    /// The password was right. Tries that are under way at once can make it some more than the limit.
    pub fn was_right(&mut self, attempt: &Attempt, user: &UserName, now: Instant) {
        self.give_back(attempt);
        // So there are no more than users who were active within a minute.
        self.successes.retain(|_, rate| !rate.is_idle(now));
        self.successes.entry(user.clone()).or_default().count(now, SUCCESSES);
    }

    /// Remembers that this user comes from this address, with a new count.
    fn know(&mut self, user: &UserName, source: IpAddr, now: Instant) {
        if self.known.len() >= MAX_ACCOUNTS && !self.known.contains_key(user) {
            self.known.pop_first();
        }
        let known = self.known.entry(user.clone()).or_default();
        known.retain(|(address, _)| *address != source);
        if known.len() >= MAX_KNOWN_SOURCES {
            known.remove(0);
        }
        known.push((source, Count { failures: 0, last: now }));
    }

    fn known_count(&mut self, user: &UserName, source: IpAddr) -> Option<&mut Count> {
        let known = self.known.get_mut(user)?;
        known.iter_mut().find(|(address, _)| *address == source).map(|(_, count)| count)
    }

    fn count_of(&mut self, source: IpAddr, now: Instant) -> &mut Count {
        if self.sources.len() >= MAX_SOURCES && !self.sources.contains_key(&source) {
            self.sources.retain(|_, count| now < count.last + FORGOTTEN_AFTER);
            if self.sources.len() >= MAX_SOURCES
                && let Some(oldest) =
                    self.sources.iter().min_by_key(|(_, count)| count.last).map(|(source, _)| *source)
            {
                self.sources.remove(&oldest);
            }
        }
        self.sources.entry(source).or_default()
    }

    fn account(&self, name: &str) -> usize {
        let mut digest = Sha256::new();
        digest.update(self.seed);
        digest.update(name.as_bytes());
        let hash: [u8; 32] = digest.finalize().into();
        let [one, two, ..] = hash;
        usize::from(u16::from_be_bytes([one, two])) % ACCOUNT_COUNTS
    }
}

/// How long failures of one user are counted before the count stands in the audit log.
const TOLD_EVERY: Duration = Duration::from_secs(60);

/// Failures of one user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failed {
    /// The user.
    pub user: UserName,
    /// How many.
    pub times: u64,
    /// Where the last one came from.
    pub source: IpAddr,
}

/// Which failures the audit log tells of: the first one of a user at once, those of each minute after it as a
/// count. So somebody who tries passwords cannot fill the disk.
#[derive(Debug, Default)]
pub struct Failures {
    of: BTreeMap<UserName, (Instant, u64, IpAddr)>,
}

impl Failures {
    /// Notes a failure of a user that there is. What to write now.
    pub fn note(&mut self, user: &UserName, source: IpAddr, now: Instant) -> Option<Failed> {
        if let Some((_, times, last)) = self.of.get_mut(user) {
            (*times, *last) = (*times + 1, source);
            return None;
        }
        // Users that were removed within the last minute can make it more for a moment.
        if self.of.len() >= 2 * MAX_ACCOUNTS {
            return None;
        }
        self.of.insert(user.clone(), (now, 0, source));
        Some(Failed { user: user.clone(), times: 1, source })
    }

    /// The counts to write now.
    pub fn due(&mut self, now: Instant) -> Vec<Failed> {
        let mut due = Vec::new();
        self.of.retain(|user, (since, times, source)| {
            if now.since(*since) < TOLD_EVERY {
                return true;
            }
            let is_told = *times > 0;
            if is_told {
                due.push(Failed { user: user.clone(), times: *times, source: *source });
                (*since, *times) = (now, 0);
            }
            is_told
        });
        due
    }

    /// The counts that were not written yet, at the end.
    pub fn rest(&mut self) -> Vec<Failed> {
        let all = std::mem::take(&mut self.of).into_iter();
        let rest = all.filter(|(_, (_, times, _))| *times > 0);
        rest.map(|(user, (_, times, source))| Failed { user, times, source }).collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn address(number: u32) -> IpAddr {
        IpAddr::from(number.to_be_bytes())
    }

    fn anna() -> UserName {
        UserName::new("anna").unwrap()
    }

    const HOME: u32 = 7;

    /// Counts at which anna signed in from her address.
    fn with_anna(now: Instant) -> SignIns {
        let mut counts = SignIns::new([1; 32]);
        let attempt = counts.begin("anna", address(HOME), now).unwrap();
        counts.succeeded(&attempt, &anna(), now);
        counts
    }

    fn begin() -> Instant {
        Instant::ORIGIN + Duration::from_secs(3600)
    }

    /// How many tries pass in an hour, if `try_at` tries as fast as it can.
    fn passed(mut try_at: impl FnMut(Instant) -> Result<Attempt, Duration>) -> usize {
        let (mut now, end) = (begin(), begin() + Duration::from_secs(3600));
        let mut passed = 0;
        while now < end {
            match try_at(now) {
                Ok(_) => passed += 1,
                Err(wait) => now += wait,
            }
        }
        passed
    }

    #[test]
    fn one_address_has_a_try_a_minute_in_the_long_run() {
        let mut counts = SignIns::new([1; 32]);
        let mut number = 0_u32;
        let of_many_names = passed(|now| {
            number += 1;
            counts.begin(&format!("name-{number}"), address(1), now)
        });
        assert!((60..75).contains(&of_many_names), "{of_many_names}");
        let mut counts = SignIns::new([1; 32]);
        // All addresses of one IPv6 network are one.
        let of_network = passed(|now| {
            number += 1;
            let source = IpAddr::V6(Ipv6Addr::from_bits((0x2001 << 112) + u128::from(number)));
            counts.begin("anna", source, now)
        });
        assert!((60..75).contains(&of_network), "{of_network}");
    }

    #[test]
    fn one_name_has_a_try_each_8_seconds_from_all_addresses_together() {
        let mut counts = SignIns::new([1; 32]);
        let mut number = 100;
        let passed = passed(|now| {
            number += 1;
            counts.begin("anna", address(number), now)
        });
        assert!((440..480).contains(&passed), "{passed}");
    }

    #[test]
    fn a_success_gives_no_more_tries_at_other_names() {
        let mut counts = with_anna(begin());
        let mut sources = 0;
        for number in 0..100 {
            let now = begin() + Duration::from_millis(number);
            // Anna tries to find the password of ben, and signs in in between, as often as she may.
            sources += u32::from(counts.begin("ben", address(HOME), now).is_ok());
            if number % 12 != 0 {
                continue;
            }
            let own = counts.begin("anna", address(HOME), now).unwrap();
            counts.succeeded(&own, &anna(), now);
        }
        assert_eq!(sources, OF_SOURCE.free);
    }

    #[test]
    fn a_user_who_signs_in_without_end_waits_and_no_other() {
        let mut counts = SignIns::new([1; 32]);
        let (mut now, end) = (begin(), begin() + Duration::from_secs(3600));
        let (mut signed_in, mut number) = (0, 0);
        while now < end {
            number += 1;
            // From one address or from many.
            match counts.begin("anna", address(number % 3), now) {
                Ok(attempt) => {
                    counts.succeeded(&attempt, &anna(), now);
                    signed_in += 1;
                }
                Err(wait) => now += wait,
            }
        }
        assert!((720..=731).contains(&signed_in), "{signed_in}");
        let ben = counts.begin("ben", address(HOME), now);
        assert!(ben.is_ok() && counts.successes.len() == 1);
        // After a pause all is as at first.
        let later = now + Duration::from_secs(60);
        for _ in 0..10 {
            let attempt = counts.begin("anna", address(HOME), later).unwrap();
            counts.was_right(&attempt, &anna(), later);
        }
        assert_eq!(counts.begin("anna", address(HOME), later).unwrap_err(), Duration::from_secs(5));
    }

    proptest! {
        /// Whatever strangers try, anna does not wait where she has signed in before, and 8 s at most where
        /// no stranger has tried. The tables stay within their limits.
        #[test]
        fn strangers_lock_no_user_out(
            tries in prop::collection::vec((0..3_u8, 0..3_000_u32, 0..200_u64), 1..2_000),
        ) {
            let mut now = begin();
            let mut counts = with_anna(now);
            for (kind, number, wait) in tries {
                now += Duration::from_millis(wait);
                let name = if kind == 0 { format!("made-up-{number}") } else { "anna".to_owned() };
                // Other addresses than hers.
                let _ = counts.begin(&name, address(1_000 + number), now);
                if kind == 2 {
                    let _ = counts.begin_with_secret(address(1_000 + number), now);
                }
            }
            prop_assert!(counts.sources.len() <= MAX_SOURCES && counts.accounts.len() == ACCOUNT_COUNTS);
            let wait = counts.begin("anna", address(1), now).err().unwrap_or_default();
            prop_assert!(wait <= OF_ACCOUNT.longest, "{:?}", wait);
            let at_home = counts.begin("anna", address(HOME), now);
            prop_assert!(at_home.is_ok());
            counts.succeeded(&at_home.unwrap(), &anna(), now);
            prop_assert!(counts.known[&anna()].len() <= MAX_KNOWN_SOURCES);
        }

        /// A try after the wait that a refusal gave is let through, if nothing else failed meanwhile.
        #[test]
        fn the_wait_is_as_long_as_told(tries in prop::collection::vec(0..2_u32, 1..100)) {
            let mut now = begin();
            let mut counts = with_anna(now);
            for who in tries {
                let source = address([1, HOME][who as usize]);
                if let Err(wait) = counts.begin("anna", source, now) {
                    now += wait;
                    prop_assert!(counts.begin("anna", source, now).is_ok());
                }
            }
        }
    }

    #[test]
    fn a_user_who_comes_from_many_addresses_is_known_from_the_last_ones() {
        let mut counts = SignIns::new([1; 32]);
        for number in 0..20 {
            // No faster than the limit of successes.
            let now = begin() + Duration::from_secs(5 * u64::from(number));
            let attempt = counts.begin("anna", address(number), now).unwrap();
            counts.succeeded(&attempt, &anna(), now);
        }
        let known: Vec<_> = counts.known[&anna()].iter().map(|(source, _)| *source).collect();
        assert_eq!(known, [16, 17, 18, 19].map(address));
    }

    #[test]
    fn failures_of_a_user_stand_in_the_log_once_and_then_as_counts() {
        let mut failures = Failures::default();
        let at = |seconds| begin() + Duration::from_secs(seconds);
        let failed = |times| Failed { user: anna(), times, source: address(1) };
        assert_eq!(failures.note(&anna(), address(1), at(0)), Some(failed(1)));
        for _ in 0..1_000 {
            assert_eq!(failures.note(&anna(), address(1), at(1)), None);
        }
        assert!(failures.due(at(59)).is_empty());
        assert_eq!(failures.due(at(60)), [failed(1_000)]);
        assert_eq!(failures.note(&anna(), address(1), at(61)), None);
        assert_eq!(failures.rest(), [failed(1)]);
        assert!(failures.due(at(200)).is_empty());
        assert_eq!(
            failures.note(&anna(), address(1), at(200)),
            Some(failed(1)),
            "a quiet minute begins anew"
        );
    }
}
