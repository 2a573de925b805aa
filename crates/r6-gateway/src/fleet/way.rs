//! How a robot is reached: the gateway connects to it, or it connects to the gateway.

use std::fmt;
use std::net::{IpAddr, SocketAddr};

use r6_client::RequestError;

/// What the address of a robot that connects to the gateway looks like, for messages.
pub const DIALS_IN: &str = "listen:ADDR:PORT,from:ADDR, such as listen:192.168.1.2:9770,from:192.168.1.31";

const LISTEN: &str = "listen:";
const FROM: &str = ",from:";

/// The way to a robot, as the text of its address says it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Way {
    /// The gateway connects to this host and port.
    Dial(String),
    /// The controller is in client mode, and connects to the gateway.
    DialsIn {
        /// Where the gateway listens for it: the address that its pendant has.
        listen: SocketAddr,
        /// The address of the controller. Connections of others are closed.
        from: IpAddr,
    },
}

impl Way {
    /// Reads the address of a robot: `HOST[:PORT]`, or `listen:ADDR:PORT,from:ADDR`.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(address: &str) -> Result<Self, String> {
        let Some(dials_in) = address.strip_prefix(LISTEN) else {
            let address = r6_client::address_with_port(address);
            return address.map(Self::Dial).map_err(|error| RequestError::Invalid(error).to_string());
        };
        let wrong = |what: &str| {
            let shown: String = address.chars().take(256).collect();
            format!("`{shown}` is not {DIALS_IN}: {what}")
        };
        let Some((listen, from)) = dials_in.split_once(FROM) else {
            // Anybody who reaches the port would be taken for the robot.
            return Err(wrong("it has to say from which address the robot connects"));
        };
        let listen = listen
            .parse::<SocketAddr>()
            .ok()
            .filter(|listen| listen.port() != 0)
            .ok_or_else(|| wrong("where to listen is an address of this machine and a port"))?;
        let from = from.parse::<IpAddr>().ok().filter(|from| !from.is_unspecified()).ok_or_else(|| {
            wrong("the robot's address is four numbers, or IPv6; a name could be anybody's")
        })?;
        Ok(Self::DialsIn { listen, from: from.to_canonical() })
    }

    /// Whether the robot connects to the gateway. Its pendant has the address of this machine, so no other
    /// gateway can take it over.
    #[must_use]
    pub fn dials_in(&self) -> bool {
        matches!(self, Self::DialsIn { .. })
    }

    /// Two robots with the same place cannot be told apart: host and port, or where the gateway listens.
    #[must_use]
    pub fn place(&self) -> String {
        match self {
            Self::Dial(address) => address.clone(),
            Self::DialsIn { listen, .. } => format!("{LISTEN}{listen}"),
        }
    }
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Dial(address) => f.write_str(address),
            Self::DialsIn { listen, from } => write!(f, "{LISTEN}{listen}{FROM}{from}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_says_who_connects_to_whom() {
        for (address, place, dials_in) in [
            ("192.168.1.31", "192.168.1.31:9760", false),
            ("press-4:9761", "press-4:9761", false),
            ("listener:9761", "listener:9761", false),
            ("listen:192.168.1.2:9770,from:192.168.1.31", "listen:192.168.1.2:9770", true),
            ("listen:[::]:9770,from:fd00::31", "listen:[::]:9770", true),
        ] {
            let way = Way::read(address).unwrap();
            assert_eq!((way.place().as_str(), way.dials_in()), (place, dials_in), "{address}");
            assert_eq!(Way::read(&way.to_string()), Ok(way), "{address}");
        }
        // As the system tells the peer of a socket that listens for both.
        let mapped = Way::read("listen:[::]:9770,from:::ffff:192.168.1.31").unwrap();
        assert_eq!(mapped.to_string(), "listen:[::]:9770,from:192.168.1.31");
    }

    #[test]
    fn what_is_no_address_of_a_robot_is_refused_with_its_reason() {
        for (address, reason) in [
            ("listen:192.168.1.2:9770", "from which address"),
            ("listen:9770,from:192.168.1.31", "where to listen"),
            ("listen:192.168.1.2:0,from:192.168.1.31", "where to listen"),
            ("listen:hall-pc:9770,from:192.168.1.31", "where to listen"),
            ("listen:192.168.1.2:9770,from:press-4", "the robot's address"),
            ("listen:192.168.1.2:9770,from:0.0.0.0", "the robot's address"),
            ("listen:192.168.1.2:9770,from:", "the robot's address"),
            ("press 4", "a host has no blanks"),
        ] {
            let refused = Way::read(address).unwrap_err();
            assert!(refused.contains(reason) && refused.contains(address), "{refused}");
        }
    }
}
