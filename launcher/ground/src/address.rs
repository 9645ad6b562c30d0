//! Address of a ground station, as MAVLink's tools write it.

use std::fmt::{self, Display, Formatter};
use std::net::{SocketAddr, ToSocketAddrs};
use std::str::FromStr;

/// Way in which the link begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Messages are sent to the address, and answers are taken from there only.
    Out,
    /// The address is this process's own; messages are sent to the station that sent a message last.
    In,
}

/// Address such as `udpout:127.0.0.1:14550`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Address {
    /// Way in which the link begins.
    pub way: Way,
    /// Address of the station, or of this process.
    pub at: SocketAddr,
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || {
            format!(
                "'{text}' is no address: udpout:HOST:PORT (QGroundControl: udpout:127.0.0.1:14550) or udpin:HOST:PORT"
            )
        };
        let (way, at) = text.split_once(':').ok_or_else(form)?;
        let way = match way {
            "udpout" => Way::Out,
            "udpin" => Way::In,
            _ => return Err(form()),
        };
        let found = at.to_socket_addrs().map_err(|error| format!("{}: {error}", form()))?.next();
        Ok(Self { way, at: found.ok_or_else(form)? })
    }
}

impl Display for Address {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let way = if self.way == Way::Out { "udpout" } else { "udpin" };
        write!(f, "{way}:{}", self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_those_of_the_tools_and_others_are_refused() {
        let out = Address { way: Way::Out, at: "127.0.0.1:14550".parse().unwrap() };
        assert_eq!("udpout:127.0.0.1:14550".parse(), Ok(out));
        assert_eq!(out.to_string(), "udpout:127.0.0.1:14550");
        assert_eq!("udpin:[::1]:9".parse(), Ok(Address { way: Way::In, at: "[::1]:9".parse().unwrap() }));
        for text in
            ["", "127.0.0.1:14550", "udp:127.0.0.1:14550", "udpout:127.0.0.1", "udpout:127.0.0.1:99999", "tcp:1:2"]
        {
            let error = text.parse::<Address>().unwrap_err();
            assert!(error.contains("udpout:127.0.0.1:14550"), "{error}");
        }
    }
}
