//! Which source may do what on a raw port.

use std::fmt;
use std::net::IpAddr;

use r6_api::gateway::{Deed, RawPortRule};
use r6_proto::Command;
use r6_proto::message::{CommandName, Effect};

use crate::core::camera::Camera;
use crate::core::name::RobotName;
use crate::core::order::Order;

/// How many rules an entry of the audit log has. A file with more of them must not make it large.
const MAX_TOLD: usize = 100;

/// How many cameras a rule names at most. A computer looks after a few.
pub const MAX_CAMERAS: usize = 16;

/// How many programs a rule names at most.
pub const MAX_PROGRAMS: usize = 100;

/// The words of the commands and requests that need the lease: a rule can name those that it allows.
#[must_use]
pub fn raw_words() -> Vec<&'static str> {
    let changes = |name: &CommandName| name.effect() == Effect::Changes || name.effect() == Effect::Moves;
    let commands = CommandName::ALL.into_iter().filter(changes).map(CommandName::word);
    commands.chain([Order::LIST]).collect()
}

/// What a rule allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RawAllow {
    /// Nothing: the connection is closed at once.
    Deny,
    /// Queries and stops.
    Read,
    /// Also what changes or moves, with the implicit lease.
    Command,
}

impl RawAllow {
    /// Its word in the file: `deny`, `read`, `command`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Deny => "deny",
            Self::Read => "read",
            Self::Command => "command",
        }
    }

    /// What this word allows.
    #[must_use]
    pub fn of_word(word: &str) -> Option<Self> {
        [Self::Deny, Self::Read, Self::Command].into_iter().find(|allow| allow.word() == word)
    }
}

/// An address, or all addresses with the same first bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawSource {
    address: IpAddr,
    bits: u32,
}

impl RawSource {
    /// What a source is, for people.
    pub const WANTED: &str = "an address, such as 192.168.1.20, or a network without host bits, such as \
                              192.168.1.0/24";

    /// The source with this text: an IPv4 or IPv6 address, or such an address with `/` and its length in
    /// bits. `None` for anything else, and for a network whose address has bits behind its length.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let (address, bits) = match text.split_once('/') {
            Some((address, bits)) => (address, Some(bits)),
            None => (text, None),
        };
        let address: IpAddr = address.parse().ok()?;
        if matches!(address, IpAddr::V6(address) if address.to_ipv4_mapped().is_some()) {
            // It would cover no client: such a client counts as the IPv4 address that it is.
            return None;
        }
        let all = if address.is_ipv4() { 32 } else { 128 };
        let bits = match bits {
            Some(bits) if bits.is_empty() || !bits.bytes().all(|byte| byte.is_ascii_digit()) => return None,
            Some(bits) => bits.parse().ok().filter(|bits| *bits <= all)?,
            None => all,
        };
        let source = Self { address, bits };
        (source.first_bits(address)? == number(address)).then_some(source)
    }

    /// Whether it has this address. An IPv4 address is the same if it comes as `::ffff:a.b.c.d`.
    #[must_use]
    pub fn covers(&self, address: IpAddr) -> bool {
        let address = address.to_canonical();
        self.first_bits(address).is_some_and(|first| first == number(self.address))
    }

    /// The address with all bits behind the length 0; `None` for an address of the other kind.
    fn first_bits(&self, address: IpAddr) -> Option<u128> {
        if address.is_ipv4() != self.address.is_ipv4() {
            return None;
        }
        let behind = if address.is_ipv4() { 32 - self.bits } else { 128 - self.bits };
        // If no bit counts, all bits would be shifted out, which `>>` does not do.
        Some(number(address).checked_shr(behind).map_or(0, |first| first << behind))
    }
}

fn number(address: IpAddr) -> u128 {
    match address {
        IpAddr::V4(address) => u128::from(u32::from(address)),
        IpAddr::V6(address) => u128::from(address),
    }
}

impl fmt::Display for RawSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = if self.address.is_ipv4() { 32 } else { 128 };
        self.address.fmt(f)?;
        if self.bits < all { write!(f, "/{}", self.bits) } else { Ok(()) }
    }
}

/// One rule.
#[derive(Clone, Debug, PartialEq)]
pub struct RawRule {
    /// The sources that it is for.
    pub source: RawSource,
    /// The only robot that it is for; `None` for all.
    pub robot: Option<RobotName>,
    /// What it allows.
    pub allow: RawAllow,
    /// The only words that they may send of those that need the lease, out of [`raw_words`]; `None` for all.
    pub commands: Option<Vec<&'static str>>,
    /// The only programs of the controller that they may switch to and start; `None` for all.
    pub programs: Option<Vec<String>>,
    /// The highest global speed that these sources may set, percent; `None` for any.
    pub max_global_speed: Option<f64>,
    /// The highest speed of moves in their lists, percent; `None` for any.
    pub max_speed: Option<f64>,
    /// The highest path speed in their lists, mm/s; `None` for any.
    pub max_path_speed: Option<u32>,
    /// The cameras as which they may send points and answer photos, without the lease: [`MAX_CAMERAS`].
    pub cameras: Vec<Camera>,
}

impl RawRule {
    /// A rule without limits for all robots.
    #[must_use]
    pub fn new(source: RawSource, allow: RawAllow) -> Self {
        Self {
            source,
            robot: None,
            allow,
            commands: None,
            programs: None,
            max_global_speed: None,
            max_speed: None,
            max_path_speed: None,
            cameras: Vec::new(),
        }
    }

    /// Why these sources may not send a command, whatever the lease and the controller say; `None` if they
    /// may. Lists are checked by an envelope of the client.
    #[must_use]
    pub fn forbids(&self, order: &Order) -> Option<String> {
        let word = order.word();
        if let Some(commands) = self.commands.as_ref().filter(|commands| !commands.contains(&word)) {
            return Some(format!("this address may send only {}, not {word}", list(commands)));
        }
        match (order, self.max_global_speed, &self.programs) {
            (Order::Command(Command::ModifyGspd { percent }), Some(most), _)
                if !(0.0..=most).contains(percent) =>
            {
                Some(format!("this address may set a global speed of {most} % at most, not {percent} %"))
            }
            (Order::Command(Command::SwitchMold { mold }), _, Some(programs))
                if !programs.iter().any(|program| program == mold) =>
            {
                Some(format!("this address may run only the programs {}, not `{mold}`", list(programs)))
            }
            _ => None,
        }
    }

    /// Whether [`Self::forbids_start`] has to be asked, too: they may start some programs only.
    #[must_use]
    pub fn asks_for_program(&self, order: &Order) -> bool {
        matches!(order, Order::Command(command) if command.name().starts()) && self.programs.is_some()
    }

    /// Why these sources may not start the program that the controller has loaded; `None` if they may.
    /// `loaded`: its name, if the controller says it.
    #[must_use]
    pub fn forbids_start(&self, loaded: Option<&str>) -> Option<String> {
        let programs = self.programs.as_ref()?;
        match loaded {
            Some(loaded) if programs.iter().any(|program| program == loaded) => None,
            Some(loaded) => {
                Some(format!("this address may run only the programs {}, not `{loaded}`", list(programs)))
            }
            None => Some(format!(
                "this address may run only the programs {}, and the controller does not say which one is loaded (it has no curMold)",
                list(programs)
            )),
        }
    }
}

/// Some names, with commas; `(none)` for none.
fn list(names: &[impl AsRef<str>]) -> String {
    let names: Vec<_> = names.iter().map(AsRef::as_ref).collect();
    if names.is_empty() { "(none)".to_owned() } else { names.join(", ") }
}

/// The rules of all raw ports, in their order.
#[derive(Clone, Debug, PartialEq)]
pub struct RawPolicy {
    rules: Vec<RawRule>,
}

impl Default for RawPolicy {
    /// Programs of this machine may read and stop; others nothing.
    fn default() -> Self {
        let sources = ["127.0.0.0/8", "::1"].into_iter().filter_map(RawSource::parse);
        Self { rules: sources.map(|source| RawRule::new(source, RawAllow::Read)).collect() }
    }
}

impl RawPolicy {
    /// These rules. Without any, no source may do anything.
    #[must_use]
    pub fn new(rules: Vec<RawRule>) -> Self {
        Self { rules }
    }

    /// The rules, in their order.
    #[must_use]
    pub fn rules(&self) -> &[RawRule] {
        &self.rules
    }

    /// What the audit log tells of the rules.
    #[must_use]
    pub fn deed(&self) -> Deed {
        let rules = self.rules.iter().take(MAX_TOLD).map(|rule| RawPortRule {
            source: rule.source.to_string(),
            only: rule.robot.as_ref().map(ToString::to_string),
            allow: rule.allow.word().to_owned(),
            commands: rule
                .commands
                .as_ref()
                .map(|words| words.iter().map(|word| (*word).to_owned()).collect()),
            programs: rule.programs.clone(),
            max_global_speed: rule.max_global_speed,
            max_speed: rule.max_speed,
            max_path_speed: rule.max_path_speed,
            cameras: rule.cameras.iter().map(|camera| camera.number()).collect(),
        });
        Deed::RawRules { rules: rules.collect(), more: self.rules.len().saturating_sub(MAX_TOLD) }
    }

    /// The first rule for this address and robot. `None`: the source may do nothing.
    #[must_use]
    pub fn rule(&self, address: IpAddr, robot: &str) -> Option<&RawRule> {
        let is_for = |rule: &&RawRule| {
            rule.source.covers(address) && rule.robot.as_ref().is_none_or(|only| only.as_str() == robot)
        };
        self.rules.iter().find(is_for).filter(|rule| rule.allow != RawAllow::Deny)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn rule(source: &str, allow: RawAllow) -> RawRule {
        RawRule::new(RawSource::parse(source).unwrap(), allow)
    }

    fn allowed(policy: &RawPolicy, address: &str) -> Option<RawAllow> {
        policy.rule(address.parse().unwrap(), "press").map(|rule| rule.allow)
    }

    #[test]
    fn the_first_rule_decides_and_without_a_rule_nothing_is_allowed() {
        let policy = RawPolicy::new(vec![
            rule("192.168.1.20", RawAllow::Command),
            rule("192.168.1.66", RawAllow::Deny),
            rule("192.168.1.0/24", RawAllow::Read),
            rule("192.168.1.30", RawAllow::Command),
        ]);
        for (address, allow) in [
            ("192.168.1.20", Some(RawAllow::Command)),
            ("::ffff:192.168.1.20", Some(RawAllow::Command)),
            ("192.168.1.66", None),
            ("192.168.1.30", Some(RawAllow::Read)),
            ("192.168.2.20", None),
            ("127.0.0.1", None),
            ("::1", None),
        ] {
            assert_eq!(allowed(&policy, address), allow, "{address}");
        }
        assert_eq!(allowed(&RawPolicy::new(Vec::new()), "127.0.0.1"), None);
        let usual = RawPolicy::default();
        assert_eq!(allowed(&usual, "127.0.0.9"), Some(RawAllow::Read));
        assert_eq!(allowed(&usual, "::1"), Some(RawAllow::Read));
        assert_eq!(allowed(&usual, "10.0.0.1"), None);
    }

    #[test]
    fn a_rule_may_be_for_one_robot() {
        let only = RawRule { robot: RobotName::new("saw"), ..rule("0.0.0.0/0", RawAllow::Command) };
        let policy = RawPolicy::new(vec![only, rule("10.0.0.0/8", RawAllow::Read)]);
        let of = |robot| policy.rule("10.1.2.3".parse().unwrap(), robot).map(|rule| rule.allow);
        assert_eq!((of("saw"), of("press")), (Some(RawAllow::Command), Some(RawAllow::Read)));
    }

    #[test]
    fn a_source_is_read_and_shown() {
        for text in ["192.168.1.20", "192.168.1.0/24", "0.0.0.0/0", "::1", "fd00::/8", "::/0"] {
            assert_eq!(RawSource::parse(text).unwrap().to_string(), text);
        }
        assert_eq!(RawSource::parse("10.0.0.1/32").unwrap().to_string(), "10.0.0.1");
        for text in [
            "",
            "press",
            "192.168.1.20/24",
            "10.0.0.0/33",
            "::/129",
            "10.0.0.0/",
            "10.0.0.0/+8",
            "10/8",
            "::ffff:10.0.0.5",
        ] {
            assert_eq!(RawSource::parse(text), None, "{text}");
        }
    }

    #[test]
    fn a_limit_of_the_global_speed_forbids_more() {
        let limited = RawRule { max_global_speed: Some(30.0), ..rule("::1", RawAllow::Command) };
        assert_eq!(limited.forbids(&Command::ModifyGspd { percent: 30.0 }.into()), None);
        assert!(
            limited.forbids(&Command::ModifyGspd { percent: 30.1 }.into()).unwrap().contains("30 % at most")
        );
        assert!(limited.forbids(&Command::ModifyGspd { percent: f64::NAN }.into()).is_some());
        assert_eq!(limited.forbids(&Command::StartButton.into()), None);
        assert_eq!(
            rule("::1", RawAllow::Command).forbids(&Command::ModifyGspd { percent: 100.0 }.into()),
            None
        );
    }

    #[test]
    fn a_rule_names_the_commands_and_the_programs_that_it_allows() {
        let commands = Some(vec!["modifyGSPD", "AddRCC"]);
        let some = RawRule { commands, ..rule("::1", RawAllow::Command) };
        assert_eq!(some.forbids(&Command::ModifyGspd { percent: 30.0 }.into()), None);
        assert_eq!(some.forbids(&Order::List { replace: true, steps: Vec::new() }), None);
        let start = Command::StartButton.into();
        assert_eq!(
            some.forbids(&start).unwrap(),
            "this address may send only modifyGSPD, AddRCC, not startButton"
        );
        let words = raw_words();
        assert!(words.contains(&"startButton") && words.contains(&"AddRCC") && words.contains(&"modifyGSPD"));
        assert!(!words.contains(&"actionStop"), "a stop needs no lease");

        let programs = Some(vec!["press".to_owned(), "drill".to_owned()]);
        let some = RawRule { programs, ..rule("::1", RawAllow::Command) };
        let switch = |mold: &'static str| Command::SwitchMold { mold: mold.into() }.into();
        assert_eq!(some.forbids(&switch("drill")), None);
        let other = "this address may run only the programs press, drill, not `saw`";
        assert_eq!(some.forbids(&switch("saw")).unwrap(), other);
        assert!(some.asks_for_program(&start) && !some.asks_for_program(&switch("drill")));
        assert_eq!((some.forbids(&start), some.forbids_start(Some("press"))), (None, None));
        assert_eq!(some.forbids_start(Some("saw")).unwrap(), other);
        assert!(some.forbids_start(None).unwrap().contains("does not say which one is loaded"));
        let none = RawRule { programs: Some(Vec::new()), ..rule("::1", RawAllow::Command) };
        assert!(none.forbids_start(Some("press")).unwrap().contains("only the programs (none)"));
        let all = rule("::1", RawAllow::Command);
        assert!(!all.asks_for_program(&start) && all.forbids_start(None).is_none());
    }

    proptest! {
        /// A network has exactly the addresses with its first bits.
        #[test]
        fn a_network_has_the_addresses_with_its_first_bits(
            network in any::<u32>(), other in any::<u32>(), bits in 0_u32..=32
        ) {
            let mask = u32::MAX.checked_shl(32 - bits).unwrap_or(0);
            let base = std::net::Ipv4Addr::from(network & mask);
            let source = RawSource::parse(&format!("{base}/{bits}")).unwrap();
            for address in [network, other, network ^ 1, network ^ (1 << 31)] {
                let covers = source.covers(IpAddr::V4(address.into()));
                prop_assert_eq!(covers, address & mask == network & mask);
            }
        }
    }
}
