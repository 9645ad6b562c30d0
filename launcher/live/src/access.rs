//! Rules for connections to a live server, the same for all its paths and websockets.
//!
//! | request | accepted if |
//! |---|---|
//! | any | it carries the token: in the cookie, as `Authorization: Bearer`, or as `?token=` |
//! | any, server on loopback | besides, `Host` is a name of this machine's loopback, with the server's port |
//! | any | besides, `Origin` is absent or the page's own |
//! | websocket of Foxglove, token not in the cookie | besides, `Origin` is anything: its application is another origin |
//!
//! Only the token tells users of one machine apart: every user can reach a port on loopback. The check of `Host`
//! refuses a website whose name was made to point to this machine (DNS rebinding). The check of `Origin` refuses a page
//! of another origin that has the cookie sent along: to a browser all ports of a host are one site.

use std::fs;
use std::net::{IpAddr, SocketAddr};

use anyhow::{Context, ensure};
use axum::http::{HeaderMap, HeaderName, Uri, header};

/// Shortest token that is accepted \[characters\].
const TOKEN_CHARS: usize = 16;
/// Number of random bytes in a generated token.
const TOKEN_BYTES: usize = 18;

/// Rule for all requests of one server.
#[derive(Debug, Clone)]
pub struct Access {
    address: SocketAddr,
    token: String,
}

/// Reason for which a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RequestRefused {
    Token,
    Host,
    Origin,
}

impl RequestRefused {
    /// Describes the reason and the remedy.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Token => {
                "the token is missing or wrong: open the whole address that `trefoil` has printed, or send \
                 `Authorization: Bearer TOKEN`"
            }
            Self::Host => "this is no name of this machine: use the address that `trefoil` has printed",
            Self::Origin => "another website may not connect; Foxglove needs its address with ?token=TOKEN",
        }
    }
}

impl Access {
    /// Makes the rule for a server on `address`, and a token unless one is given.
    ///
    /// # Errors
    /// The token is too short, or has characters that an address cannot have.
    pub fn new(address: SocketAddr, token: Option<String>) -> anyhow::Result<Self> {
        let is_fit = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        let token = token.map_or_else(random, Ok)?;
        ensure!(
            token.len() >= TOKEN_CHARS && token.chars().all(is_fit),
            "a token has {TOKEN_CHARS} letters, digits, - and _ at least; without --token one is made"
        );
        Ok(Self { address, token })
    }

    /// Returns the address of the page for a browser, with the token.
    pub fn url(&self) -> String {
        format!("http://{}/?token={}", self.address, self.token)
    }

    pub fn token(&self) -> &str {
        &self.token
    }

    /// Returns the value of `Set-Cookie` with which a browser keeps the token. The cookie's name has the port, because
    /// a browser sends the cookies of a host to all of its ports.
    pub fn cookie(&self) -> String {
        format!("{}={}; HttpOnly; SameSite=Strict; Path=/", self.cookie_name(), self.token)
    }

    fn cookie_name(&self) -> String {
        format!("trefoil-{}", self.address.port())
    }

    /// Decides on a request by its `headers` and its address `uri`; `is_foxglove` is `true` for Foxglove's websocket.
    pub fn check(&self, headers: &HeaderMap, uri: &Uri, is_foxglove: bool) -> Result<(), RequestRefused> {
        // A value that is not text counts as wrong, not as absent.
        let text = |name: HeaderName| headers.get(name).map(|value| value.to_str().unwrap_or_default());
        let bearer = text(header::AUTHORIZATION).and_then(|value| value.strip_prefix("Bearer "));
        let is_given = [bearer, token_in(uri)].into_iter().flatten().any(|given| is_same(given, &self.token));
        if !is_given && !self.has_cookie(headers) {
            return Err(RequestRefused::Token);
        }
        let host = text(header::HOST).unwrap_or_default();
        if self.address.ip().is_loopback() && !self.is_own_host(host) {
            return Err(RequestRefused::Host);
        }
        match text(header::ORIGIN) {
            None => Ok(()),
            Some(origin) if is_page_of(origin, host) || is_foxglove && is_given => Ok(()),
            Some(_) => Err(RequestRefused::Origin),
        }
    }

    /// Returns whether a cookie of the request has the token.
    fn has_cookie(&self, headers: &HeaderMap) -> bool {
        let name = self.cookie_name();
        let lists = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
        let mut pairs = lists.flat_map(|list| list.split(';')).filter_map(|pair| pair.trim().split_once('='));
        pairs.any(|(of, given)| of == name && is_same(given, &self.token))
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

/// Returns the token in an address, right or wrong; `None` if it has none.
pub fn token_in(uri: &Uri) -> Option<&str> {
    uri.query()?.split('&').find_map(|pair| pair.strip_prefix("token="))
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

#[cfg(test)]
mod tests {
    use super::*;

    const TOKEN: &str = "0123456789abcdef";
    const HOST: (HeaderName, &str) = (header::HOST, "127.0.0.1:8080");

    fn at(address: &str, token: Option<&str>) -> Access {
        Access::new(address.parse().unwrap(), token.map(str::to_owned)).unwrap()
    }

    /// Decides on a request for `path` with `headers`.
    fn check(access: &Access, path: &str, headers: &[(HeaderName, &str)]) -> Result<(), RequestRefused> {
        let headers = headers.iter().map(|(name, value)| (name.clone(), value.parse().unwrap())).collect();
        access.check(&headers, &path.parse().unwrap(), path.starts_with("/foxglove"))
    }

    #[test]
    fn the_token_opens_and_nothing_else_does() {
        for address in ["127.0.0.1:8080", "0.0.0.0:8080"] {
            let access = at(address, Some(TOKEN));
            let [bearer, cookie] = [format!("Bearer {TOKEN}"), format!("a=b; trefoil-8080={TOKEN}")];
            assert_eq!(check(&access, &format!("/?a=b&token={TOKEN}"), &[HOST]), Ok(()));
            assert_eq!(check(&access, "/", &[HOST, (header::AUTHORIZATION, &bearer)]), Ok(()));
            assert_eq!(
                check(&access, "/", &[HOST, (header::COOKIE, "trefoil-8080=old"), (header::COOKIE, &cookie)]),
                Ok(())
            );
            for path in ["/", "/?token=", "/?token=0123456789abcdeX", "/?token=0123456789abcde", "/foxglove"] {
                assert_eq!(check(&access, path, &[HOST]), Err(RequestRefused::Token), "{path}");
            }
            for cookie in ["", "trefoil-8080=", "trefoil-8080", "trefoil-8081=0123456789abcdef", "0123456789abcdef"] {
                assert_eq!(
                    check(&access, "/", &[HOST, (header::COOKIE, cookie)]),
                    Err(RequestRefused::Token),
                    "{cookie}"
                );
            }
            for value in ["", "Bearer ", "Bearer 0123456789abcdef0", "Basic 0123456789abcdef", "0123456789abcdef"] {
                assert_eq!(
                    check(&access, "/", &[HOST, (header::AUTHORIZATION, value)]),
                    Err(RequestRefused::Token),
                    "{value}"
                );
            }
        }
        assert_eq!(
            at("127.0.0.1:8080", Some(TOKEN)).cookie(),
            format!("trefoil-8080={TOKEN}; HttpOnly; SameSite=Strict; Path=/")
        );
    }

    #[test]
    fn a_server_on_loopback_answers_to_names_of_loopback_only() {
        let (access, path) = (at("127.0.0.1:8080", Some(TOKEN)), format!("/?token={TOKEN}"));
        for host in ["127.0.0.1:8080", "localhost:8080", "[::1]:8080"] {
            assert_eq!(check(&access, &path, &[(header::HOST, host)]), Ok(()), "{host}");
        }
        for host in ["evil.example:8080", "127.0.0.1", "localhost:80", "127.0.0.1.evil.example:8080", ""] {
            assert_eq!(check(&access, &path, &[(header::HOST, host)]), Err(RequestRefused::Host), "{host}");
        }
        assert_eq!(check(&access, &path, &[]), Err(RequestRefused::Host));
        assert_eq!(check(&at("0.0.0.0:8080", Some(TOKEN)), &path, &[(header::HOST, "a.name")]), Ok(()));
    }

    #[test]
    fn another_website_is_refused_but_by_foxglove_with_the_token_in_its_address() {
        let access = at("127.0.0.1:8080", Some(TOKEN));
        let (cookie, address) = (format!("trefoil-8080={TOKEN}"), |path: &str| format!("{path}?token={TOKEN}"));
        for path in ["/", "/ws", "/foxglove"] {
            let from = |origin| check(&access, path, &[HOST, (header::COOKIE, &cookie), (header::ORIGIN, origin)]);
            assert_eq!(from("http://127.0.0.1:8080"), Ok(()));
            for origin in
                ["https://evil.example", "http://127.0.0.1:9999", "null", "http://localhost:8080", "app://x", "ü"]
            {
                assert_eq!(from(origin), Err(RequestRefused::Origin), "{path} {origin}");
            }
        }
        let far = [HOST, (header::ORIGIN, "https://app.foxglove.dev")];
        assert_eq!(check(&access, &address("/ws"), &far), Err(RequestRefused::Origin));
        assert_eq!(check(&access, &address("/foxglove"), &far), Ok(()), "its owner gave it the token");
    }

    #[test]
    fn there_is_always_a_token_and_no_two_are_equal() {
        let [one, other] = [at("127.0.0.1:1", None), at("127.0.0.1:1", None)];
        assert!(one.token().len() == 24 && one.url().ends_with(one.token()), "{one:?}");
        assert_ne!(one.token(), other.token());
        for token in ["", "short", "0123456789abcde?", "0123456789 abcdef"] {
            let given = Some(token.to_owned());
            assert!(Access::new("127.0.0.1:1".parse().unwrap(), given).is_err(), "{token}");
        }
    }
}
