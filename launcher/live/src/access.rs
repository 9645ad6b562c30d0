//! Rules for connections to a live server.
//!
//! | request | accepted if |
//! |---|---|
//! | any, server with a token | it carries the token, as `?token=` or `Authorization: Bearer`, compared in constant time |
//! | any, server without one (loopback only) | the other end is a process of this user or of root, and `Host` is a name of this machine's loopback |
//! | command, websocket of the page | besides, `Origin` is absent or the page's own |
//! | websocket of Foxglove | besides, `Origin` is no website, or the page's own; with the token any |
//!
//! The check of `Host` refuses a website whose name was made to point to this machine (DNS rebinding); the check of
//! `Origin` refuses a website that opens a websocket to it. The user behind a loopback connection stands in
//! `/proc/net/tcp`: other users of the machine could connect otherwise.

use std::fs;
use std::net::{IpAddr, SocketAddr};

use anyhow::{Context, ensure};

/// Shortest token that is accepted \[characters\].
const TOKEN_CHARS: usize = 16;
/// Random bytes in a token that is made.
const TOKEN_BYTES: usize = 18;

/// Rule for all requests of one server.
#[derive(Debug, Clone)]
pub struct Access {
    address: SocketAddr,
    token: Option<String>,
}

/// One request, as far as it decides on access.
#[derive(Debug, Clone, Copy, Default)]
pub struct Asked<'a> {
    pub host: Option<&'a str>,
    pub origin: Option<&'a str>,
    /// `Authorization`, and the query of the address.
    pub authorization: Option<&'a str>,
    pub query: Option<&'a str>,
    /// `true` for the websocket of Foxglove, whose application is another origin.
    pub is_foxglove: bool,
}

/// Reason for which a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refused {
    Token,
    User,
    Host,
    Origin,
}

impl Refused {
    /// Describes the reason and the remedy.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Token => "the token is missing or wrong: use the whole address that `launcher` has printed",
            Self::User => "only the user who flies may connect without a token; start with --token to let others in",
            Self::Host => "this is no name of this machine: use the address that `launcher` has printed",
            Self::Origin => "another website may not connect; Foxglove in a browser needs a server with --token",
        }
    }
}

impl Access {
    /// Makes the rule for a server on `address`. A token is needed off loopback. One is made if it is needed and not
    /// given, or empty.
    ///
    /// # Errors
    /// The token is too short, or has characters that an address cannot have.
    pub fn new(address: SocketAddr, token: Option<String>) -> anyhow::Result<Self> {
        let token = match token {
            Some(given) if !given.is_empty() => {
                let is_fit = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
                ensure!(
                    given.len() >= TOKEN_CHARS && given.chars().all(is_fit),
                    "a token has {TOKEN_CHARS} letters, digits, - and _ at least; --token alone makes one"
                );
                Some(given)
            }
            None if address.ip().is_loopback() => None,
            Some(_) | None => Some(random()?),
        };
        Ok(Self { address, token })
    }

    /// Address of the page for a browser, with the token.
    pub fn url(&self) -> String {
        let query = self.token.as_ref().map_or(String::new(), |token| format!("?token={token}"));
        format!("http://{}/{query}", self.address)
    }

    /// Token that every request must carry, if any.
    pub fn token(&self) -> Option<&str> {
        self.token.as_deref()
    }

    /// Decides on a request; `user` finds the user of the process at the other end.
    pub fn check(&self, asked: &Asked, user: impl FnOnce() -> Option<u32>) -> Result<(), Refused> {
        if let Some(token) = &self.token {
            let bearer = asked.authorization.and_then(|value| value.strip_prefix("Bearer "));
            let in_query = asked.query.and_then(|query| query.split('&').find_map(|pair| pair.strip_prefix("token=")));
            let given = bearer.or(in_query).unwrap_or_default();
            if !is_same(given, token) {
                return Err(Refused::Token);
            }
            if asked.is_foxglove {
                return Ok(()); // a website that has the token got it from its owner
            }
        } else {
            let own = rustix::process::geteuid().as_raw();
            if !user().is_some_and(|user| user == own || user == 0) {
                return Err(Refused::User);
            }
            if !asked.host.is_some_and(|host| self.is_own_host(host)) {
                return Err(Refused::Host);
            }
        }
        match asked.origin {
            None => Ok(()),
            Some(origin) if asked.host.is_some_and(|host| is_page_of(origin, host)) => Ok(()),
            // What no website can have: applications with a scheme of their own.
            Some(origin) if asked.is_foxglove && !origin.starts_with("http") && origin != "null" => Ok(()),
            Some(_) => Err(Refused::Origin),
        }
    }

    /// Returns whether `host` is a name of this machine's loopback, with the server's port.
    fn is_own_host(&self, host: &str) -> bool {
        let port = self.address.port();
        let (name, given) = match host.rsplit_once(':') {
            Some((name, digits)) if digits.bytes().all(|b| b.is_ascii_digit()) => (name, digits.parse().ok()),
            _ => (host, Some(80)),
        };
        let address = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
        given == Some(port) && (name == "localhost" || address.is_ok_and(|address| address.is_loopback()))
    }
}

fn is_page_of(origin: &str, host: &str) -> bool {
    ["http://", "https://"].iter().any(|scheme| origin.strip_prefix(scheme) == Some(host))
}

/// Compares in a time that does not depend on where the texts differ.
fn is_same(given: &str, token: &str) -> bool {
    let differ = given.bytes().zip(token.bytes()).fold(0, |differ, (a, b)| std::hint::black_box(differ | (a ^ b)));
    given.len() == token.len() && differ == 0
}

/// Makes a random word that an address can have.
pub fn random() -> anyhow::Result<String> {
    use base64::prelude::{BASE64_URL_SAFE_NO_PAD, Engine};
    use std::io::Read;
    let mut bytes = [0; TOKEN_BYTES];
    fs::File::open("/dev/urandom")
        .and_then(|mut file| file.read_exact(&mut bytes))
        .context("cannot make a token from /dev/urandom")?;
    Ok(BASE64_URL_SAFE_NO_PAD.encode(bytes))
}

/// Finds the user of the process that connected from `peer` to `own`, both on this machine; `None` if it is not there.
pub fn user_of(peer: SocketAddr, own: SocketAddr) -> Option<u32> {
    let tables = ["/proc/net/tcp", "/proc/net/tcp6"].map(|path| fs::read_to_string(path).unwrap_or_default());
    tables.iter().find_map(|table| user_in(table, peer, own))
}

/// Finds the user of a connection in a table of the kernel: local and remote address, hexadecimal, then the user.
fn user_in(table: &str, peer: SocketAddr, own: SocketAddr) -> Option<u32> {
    let row = |line: &str| {
        let cells: Vec<&str> = line.split_whitespace().collect();
        let is = |cell: Option<&&str>, address| cell.and_then(|cell| address_of(cell)) == Some(plain(address));
        (is(cells.get(1), peer) && is(cells.get(2), own)).then(|| cells.get(7)?.parse().ok())?
    };
    table.lines().find_map(row)
}

/// Returns the address without the form of IPv4 inside IPv6.
fn plain(address: SocketAddr) -> SocketAddr {
    SocketAddr::new(address.ip().to_canonical(), address.port())
}

/// Reads an address of `/proc/net/tcp`: words of 32 bit in the order of this machine, then the port.
fn address_of(cell: &str) -> Option<SocketAddr> {
    let (address, port) = cell.split_once(':')?;
    let word = |i: usize| u32::from_str_radix(address.get(8 * i..8 * i + 8)?, 16).ok().map(u32::to_ne_bytes);
    let ip: IpAddr = match address.len() {
        8 => IpAddr::from(word(0)?),
        32 => {
            let words: Option<Vec<[u8; 4]>> = (0..4).map(word).collect();
            IpAddr::from(<[u8; 16]>::try_from(words?.concat()).ok()?)
        }
        _ => return None,
    };
    Some(plain(SocketAddr::new(ip, u16::from_str_radix(port, 16).ok()?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const OWN: Asked =
        Asked { host: Some("127.0.0.1:8080"), origin: None, authorization: None, query: None, is_foxglove: false };

    fn at(address: &str, token: Option<&str>) -> Access {
        let token = token.map(str::to_owned);
        Access::new(address.parse().unwrap(), token).unwrap()
    }

    #[expect(clippy::unnecessary_wraps, reason = "it stands for a look-up that may fail")]
    fn me() -> Option<u32> {
        Some(rustix::process::geteuid().as_raw())
    }

    #[test]
    fn without_a_token_only_this_user_and_only_under_names_of_loopback() {
        let access = at("127.0.0.1:8080", None);
        assert_eq!(access.token(), None);
        for host in ["127.0.0.1:8080", "localhost:8080", "[::1]:8080"] {
            assert_eq!(access.check(&Asked { host: Some(host), ..OWN }, me), Ok(()), "{host}");
        }
        for host in ["evil.example:8080", "127.0.0.1", "localhost:80", "127.0.0.1.evil.example:8080", ""] {
            assert_eq!(access.check(&Asked { host: Some(host), ..OWN }, me), Err(Refused::Host), "{host}");
        }
        assert_eq!(access.check(&Asked { host: None, ..OWN }, me), Err(Refused::Host));
        assert_eq!(access.check(&OWN, || Some(65_533)), Err(Refused::User));
        assert_eq!(access.check(&OWN, || None), Err(Refused::User));
    }

    #[test]
    fn another_website_is_refused_and_an_application_gets_foxglove_only() {
        let access = at("127.0.0.1:8080", None);
        let from = |origin, is_foxglove| access.check(&Asked { origin: Some(origin), is_foxglove, ..OWN }, me);
        for is_foxglove in [false, true] {
            assert_eq!(from("http://127.0.0.1:8080", is_foxglove), Ok(()));
            for origin in ["https://evil.example", "http://127.0.0.1:9999", "null", "http://localhost:8080"] {
                assert_eq!(from(origin, is_foxglove), Err(Refused::Origin), "{origin}");
            }
        }
        assert_eq!([from("app://lichtblick", true), from("app://lichtblick", false)], [Ok(()), Err(Refused::Origin)]);
    }

    #[test]
    fn the_token_opens_and_nothing_else_does() {
        let token = "0123456789abcdef";
        let access = at("0.0.0.0:8080", Some(token));
        let unasked = || -> Option<u32> { panic!("the token decides") };
        let query = format!("a=b&token={token}");
        let bearer = format!("Bearer {token}");
        let (named, far) = (Asked { query: Some(&query), ..OWN }, Some("https://app.foxglove.dev"));
        assert_eq!(access.check(&named, unasked), Ok(()));
        assert_eq!(access.check(&Asked { authorization: Some(&bearer), ..OWN }, unasked), Ok(()));
        assert_eq!(access.check(&Asked { origin: far, ..named }, unasked), Err(Refused::Origin));
        assert_eq!(access.check(&Asked { origin: far, is_foxglove: true, ..named }, unasked), Ok(()));
        for query in ["", "token=", "token=0123456789abcdeX", "token=0123456789abcde", "token=0123456789abcdef0"] {
            assert_eq!(access.check(&Asked { query: Some(query), ..OWN }, unasked), Err(Refused::Token), "{query}");
        }
    }

    #[test]
    fn off_loopback_there_is_always_a_token_and_no_two_are_equal() {
        let made = |address: &str, token| Access::new(address.parse().unwrap(), token).unwrap();
        let all = [
            made("0.0.0.0:1", None),
            made("[::]:1", None),
            made("10.0.0.1:1", None),
            made("127.0.0.1:1", Some(String::new())),
        ];
        let tokens: Vec<&str> = all.iter().filter_map(Access::token).collect();
        assert!(tokens.len() == 4 && tokens.iter().all(|token| token.len() == 24), "{tokens:?}");
        assert_ne!(tokens[0], tokens[1]);
        for token in ["short", "0123456789abcde?", "0123456789 abcdef"] {
            let given = Some(token.to_owned());
            assert!(Access::new("127.0.0.1:1".parse().unwrap(), given).is_err(), "{token}");
        }
    }

    #[test]
    fn the_user_of_a_connection_is_found() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let own = listener.local_addr().unwrap();
        let client = std::net::TcpStream::connect(own).unwrap();
        let peer = client.local_addr().unwrap();
        assert_eq!(user_of(peer, own), me());
        assert_eq!(user_of("127.0.0.1:1".parse().unwrap(), own), None);
        let table = "  sl  local_address                         remote_address\n   0: \
                     0000000000000000FFFF00000100007F:1F90 0000000000000000FFFF00000100007F:9C40 01 0:0 0:0 0 1000 0 1";
        let [peer, own] = ["127.0.0.1:8080", "127.0.0.1:40000"].map(|address| address.parse().unwrap());
        assert_eq!(user_in(table, peer, own), Some(1000));
    }
}
