//! The address of a robot as people write it: the gateway connects to it, or it connects to the gateway.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

use r6_client::RequestError;

const LISTEN: &str = "listen:";
const FROM: &str = ",from:";

/// How a robot is reached, as the text of its address says it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RobotAddress {
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

impl RobotAddress {
    /// What an address is, for people.
    pub const WANTED: &str = "HOST[:PORT], such as 192.168.1.10; or of a robot that connects to the gateway \
                              listen:ADDR:PORT,from:ADDR, such as listen:192.168.1.2:9770,from:192.168.1.31";

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
            format!("`{shown}` is not listen:ADDR:PORT,from:ADDR: {what}")
        };
        let Some((listen, from)) = dials_in.split_once(FROM) else {
            // Anybody who reaches the port would be taken for the robot.
            return Err(wrong("it has to say from which address the robot connects"));
        };
        let listen = listen
            .parse::<SocketAddr>()
            .ok()
            .filter(|listen| listen.port() != 0)
            .map(|listen| SocketAddr::new(listen.ip().to_canonical(), listen.port()))
            .ok_or_else(|| wrong("where to listen is an address of this machine and a port"))?;
        let from = from.parse::<IpAddr>().ok().map(|from| from.to_canonical());
        let is_one = |from: &IpAddr| {
            !from.is_unspecified() && !from.is_multicast() && *from != IpAddr::V4(Ipv4Addr::BROADCAST)
        };
        let from = from.filter(is_one).ok_or_else(|| {
            wrong(
                "the robot's address is numbers, such as 192.168.1.31: a name could lead to another machine",
            )
        })?;
        // Where both kinds of addresses are listened for, those of IPv4 come too.
        let is_for_both = listen.ip() == IpAddr::V6(Ipv6Addr::UNSPECIFIED);
        if listen.is_ipv4() != from.is_ipv4() && !is_for_both {
            return Err(wrong("one of the two addresses is of IPv4 and the other of IPv6: they never meet"));
        }
        Ok(Self::DialsIn { listen, from })
    }

    /// Whether the robot connects to the gateway. Its pendant has the address of this machine, so no other
    /// gateway can take it over.
    #[must_use]
    pub fn dials_in(&self) -> bool {
        matches!(self, Self::DialsIn { .. })
    }

    /// The port that the gateway listens on for this robot, if that is also one of the other robot's: both
    /// for one address, or one of them for all addresses of the machine.
    #[must_use]
    pub fn shares_port(&self, other: &Self) -> Option<u16> {
        let (Self::DialsIn { listen: one, .. }, Self::DialsIn { listen: another, .. }) = (self, other) else {
            return None;
        };
        let meet =
            one.ip() == another.ip() || [one, another].iter().any(|listen| listen.ip().is_unspecified());
        (one.port() == another.port() && meet).then_some(one.port())
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

#[cfg(test)]
mod tests {
    use super::*;

    fn read(address: &str) -> RobotAddress {
        RobotAddress::read(address).unwrap()
    }

    #[test]
    fn an_address_says_who_connects_to_whom() {
        for (address, place, dials_in) in [
            ("192.168.1.31", "192.168.1.31:9760", false),
            ("press-4:9761", "press-4:9761", false),
            ("listener:9761", "listener:9761", false),
            ("listen:192.168.1.2:9770,from:192.168.1.31", "listen:192.168.1.2:9770", true),
            ("listen:[::]:9770,from:fd00::31", "listen:[::]:9770", true),
            ("listen:[::]:9770,from:192.168.1.31", "listen:[::]:9770", true),
        ] {
            let read = read(address);
            assert_eq!((read.place().as_str(), read.dials_in()), (place, dials_in), "{address}");
        }
        // As the system tells the peer of a socket that listens for both.
        let mapped = read("listen:[::ffff:192.168.1.2]:9770,from:::ffff:192.168.1.31");
        assert_eq!(mapped, read("listen:192.168.1.2:9770,from:192.168.1.31"));
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
            ("listen:192.168.1.2:9770,from:::ffff:0.0.0.0", "the robot's address"),
            ("listen:192.168.1.2:9770,from:224.0.0.1", "the robot's address"),
            ("listen:192.168.1.2:9770,from:255.255.255.255", "the robot's address"),
            ("listen:192.168.1.2:9770,from:", "the robot's address"),
            ("listen:192.168.1.2:9770,from:fd00::31", "they never meet"),
            ("listen:[fd00::2]:9770,from:192.168.1.31", "they never meet"),
            ("press 4", "a host has no blanks"),
        ] {
            let refused = RobotAddress::read(address).unwrap_err();
            assert!(refused.contains(reason) && refused.contains(address), "{refused}");
        }
    }

    #[test]
    fn a_port_is_for_one_robot_also_if_one_listens_on_all_addresses() {
        let one = read("listen:192.168.1.2:9770,from:192.168.1.31");
        for (other, shares) in [
            ("listen:192.168.1.2:9770,from:192.168.1.32", true),
            ("listen:0.0.0.0:9770,from:192.168.1.32", true),
            ("listen:[::]:9770,from:fd00::32", true),
            ("listen:192.168.1.3:9770,from:192.168.1.32", false),
            ("listen:192.168.1.2:9771,from:192.168.1.32", false),
            ("192.168.1.2:9770", false),
        ] {
            let other = read(other);
            assert_eq!(one.shares_port(&other), shares.then_some(9770), "{other:?}");
            assert_eq!(other.shares_port(&one), shares.then_some(9770), "{other:?}");
        }
    }
}
