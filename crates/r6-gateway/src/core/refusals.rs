//! Which refusals, repeated stops and sessions of one caller stand in the audit log: a script in a loop must
//! not fill the disk.

use std::net::IpAddr;
use std::time::Duration;

use r6_proto::time::Instant;

/// One refusal of a source for one request stands in the log in this time.
pub const ONCE_IN: Duration = Duration::from_secs(60);

/// How many kinds of refusals of one address are remembered, and of all. Beyond it none is written before an
/// older one is forgotten. So an address that makes up words keeps no refusal of another from the log.
const MAX_REMEMBERED: (usize, usize) = (16, 1_024);

/// The refusals of the last minute.
#[derive(Debug, Default)]
pub struct Refusals {
    last: Vec<(IpAddr, String, Instant)>,
}

impl Refusals {
    /// Whether this refusal has to be written.
    pub fn is_written(&mut self, now: Instant, address: IpAddr, request: &str) -> bool {
        self.last.retain(|(.., at)| now.since(*at) < ONCE_IN);
        let mut own = self.last.iter().filter(|(who, ..)| *who == address);
        let (of_one, of_all) = MAX_REMEMBERED;
        let is_full = own.clone().count() >= of_one || self.last.len() >= of_all;
        if is_full || own.any(|(_, what, _)| what == request) {
            return false;
        }
        self.last.push((address, request.to_owned(), now));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_of_refusals_is_written_once_a_minute_for_each_source_and_request() {
        let mut refusals = Refusals::default();
        let begin = Instant::ORIGIN + Duration::from_secs(1);
        let (one, other) = (IpAddr::from([10, 0, 0, 1]), IpAddr::from([10, 0, 0, 2]));
        let mut written =
            |at: u64, who, what: &str| refusals.is_written(begin + Duration::from_secs(at), who, what);
        assert!(written(0, one, "startButton"));
        assert!(!written(1, one, "startButton"));
        assert!(written(1, one, "modifyGSPD"));
        assert!(written(2, other, "startButton"));
        assert!(!written(59, one, "startButton"));
        assert!(written(60, one, "startButton"));
        let made_up = (0..1_000).filter(|number| written(60, one, &number.to_string())).count();
        assert!(made_up < MAX_REMEMBERED.0, "{made_up}");
        assert!(written(61, IpAddr::from([10, 0, 0, 3]), "startButton"), "another address is not concerned");
        assert!(written(200, one, "startButton"));
    }
}
