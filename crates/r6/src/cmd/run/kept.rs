//! A program that a gateway keeps, as the command line names it.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use r6_api::Code;
use r6_proto::nearest;
use tokio::time::timeout;

use crate::by_gateway::{GatewayRobot, shortened};
use crate::exit::Failure;

/// The longest name, as a gateway takes it.
const LONGEST_NAME: usize = 64;

/// How long to ask which programs there are. The run has failed already.
const ANSWER_WITHIN: Duration = Duration::from_secs(3);

/// The name of a program, and which version of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Kept {
    /// The name.
    pub name: String,
    /// The version; the latest without one.
    pub version: Option<u64>,
}

impl FromStr for Kept {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let wanted = "write NAME or NAME@VERSION, such as pick@3; a name has 1 to 64 characters: a to z, digits, - and _";
        let (name, version) = match text.split_once('@') {
            Some((name, version)) => (name, Some(version)),
            None => (text, None),
        };
        let fits = |byte: u8| matches!(byte, b'a'..=b'z' | b'0'..=b'9' | b'-' | b'_');
        if !(1..=LONGEST_NAME).contains(&name.len()) || !name.bytes().all(fits) {
            return Err(wanted);
        }
        let version =
            version.map(|version| version.parse().ok().filter(|version| *version > 0).ok_or(wanted));
        Ok(Self { name: name.to_owned(), version: version.transpose()? })
    }
}

impl fmt::Display for Kept {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        self.version.map_or(Ok(()), |version| write!(f, "@{version}"))
    }
}

impl Kept {
    /// Says which programs or versions there are, if the gateway has not this one. Names the program before
    /// its mistakes.
    pub async fn explain(&self, failure: Failure, robot: &GatewayRobot) -> Failure {
        match failure.code() {
            Code::NoSuchProgram => match timeout(ANSWER_WITHIN, self.there(robot)).await {
                Ok(Ok(advice)) => failure.advise(advice),
                // What went wrong first is what counts.
                Ok(Err(_)) | Err(_) => failure,
            },
            Code::BadProgram => failure.in_program(&self.to_string()),
            Code::OtherText => {
                failure.advise("read the program again, check it, and name the SHA-256 of that text")
            }
            _ => failure,
        }
    }

    async fn there(&self, robot: &GatewayRobot) -> Result<String, Failure> {
        let programs = robot.gateway().programs().await?.programs;
        let names: Vec<_> = programs.iter().map(|program| program.name.as_str()).collect();
        if names.contains(&self.name.as_str()) {
            let versions = robot.gateway().program_versions(&self.name).await?.versions;
            let versions: Vec<_> = versions.iter().map(|version| version.version.to_string()).collect();
            let versions: Vec<_> = versions.iter().map(String::as_str).collect();
            return Ok(format!(
                "the gateway keeps these versions of `{}`: {}",
                self.name,
                shortened(&versions)
            ));
        }
        Ok(match nearest(&self.name, names.iter().copied()) {
            Some(near) => format!("nearest: `{near}`"),
            None if names.is_empty() => {
                "the gateway keeps no program: the dashboard, Python and `PUT /v1/programs/NAME` store one"
                    .to_owned()
            }
            None => format!("the gateway keeps {}", shortened(&names)),
        })
    }
}

/// Reads a SHA-256. Capital letters count as small ones.
pub fn sha256(text: &str) -> Result<String, &'static str> {
    let digits = text.to_ascii_lowercase();
    let is_whole = digits.len() == 64 && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_whole.then_some(digits).ok_or("a SHA-256 has 64 hexadecimal digits, as `sha256sum FILE` prints them")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kept_program_has_a_name_and_may_have_a_version() {
        let kept = |text: &str| text.parse::<Kept>().ok().map(|kept| (kept.name, kept.version));
        assert_eq!(kept("pick-2_a"), Some(("pick-2_a".to_owned(), None)));
        assert_eq!(kept("pick@12"), Some(("pick".to_owned(), Some(12))));
        for wrong in [
            "",
            "@1",
            "pick@",
            "pick@0",
            "pick@-1",
            "pick@1@2",
            "Pick",
            "a/b",
            "square.toml",
            &"x".repeat(65),
        ] {
            assert_eq!(kept(wrong), None, "{wrong}");
        }
        assert_eq!("pick@12".parse::<Kept>().unwrap().to_string(), "pick@12");
    }

    #[test]
    fn a_hash_has_64_digits() {
        assert_eq!(sha256(&"0F".repeat(32)), Ok("0f".repeat(32)));
        for wrong in ["", &"0".repeat(63), &"g".repeat(64), &"0".repeat(65)] {
            assert!(sha256(wrong).is_err(), "{wrong}");
        }
    }
}
