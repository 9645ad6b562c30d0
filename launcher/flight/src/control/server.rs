//! The launcher's side of the socket. Nothing here waits, and nothing takes long: there is one request at a look around,
//! and whoever connects and says nothing gives way to those who come later.

use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::{Duration, Instant};

use runtime::domain::Domain;
use runtime::realtime::peer_of;

use super::request::{Request, Response, SOCKET};
use crate::event::Sender;

/// A request is no longer than this.
const LINE_BYTES: usize = 4096;
/// A guest may take this long for one.
const PATIENCE: Duration = Duration::from_secs(1);
/// Guests at once; one more, and the one that has said nothing for the longest is shown out.
const GUESTS: usize = 32;
/// Guests who are let in at one look around.
const NEW_GUESTS: usize = 8;

/// The socket, and who is at it.
pub struct Server {
    listener: UnixListener,
    guests: Vec<Guest>,
    /// Whether a request came at this look.
    served: bool,
}

/// Somebody who has not finished a line yet.
struct Guest {
    stream: UnixStream,
    line: Vec<u8>,
    since: Instant,
}

/// Where the answer goes.
pub struct Reply(UnixStream);

impl Server {
    /// Opens the socket of `domain`.
    pub fn open(domain: &Domain) -> io::Result<Self> {
        let listener = UnixListener::bind(domain.file(SOCKET))?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener, guests: vec![], served: false })
    }

    /// What becomes readable when there is something to do. After a request there is nothing: the next is taken when the
    /// processes are due to be looked at anyway, so that guests do not set the release.
    pub fn sources(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        let all = [self.listener.as_fd()].into_iter().chain(self.guests.iter().map(|guest| guest.stream.as_fd()));
        all.filter(|_| !self.served)
    }

    /// A request that has come, and where the answer goes. Who brings none is told so here, and shown out.
    pub fn request(&mut self) -> Option<(Request, Reply)> {
        self.let_in();
        self.served = false;
        let mut i = 0;
        while let Some(guest) = self.guests.get_mut(i) {
            let Some(heard) = guest.listen() else {
                i += 1;
                continue;
            };
            let reply = Reply(self.guests.remove(i).stream);
            match heard {
                Ok(request) => {
                    self.served = true;
                    return Some((request, reply));
                }
                Err(why) => reply.send(&Response::Error(why)),
            }
        }
        None
    }

    fn let_in(&mut self) {
        for _ in 0..NEW_GUESTS {
            let Ok((stream, _)) = self.listener.accept() else { break };
            if stream.set_nonblocking(true).is_err() {
                continue;
            }
            if self.guests.len() == GUESTS {
                let oldest = Reply(self.guests.remove(0).stream);
                oldest.send(&Response::Error(format!("no request, and {GUESTS} others have come since")));
            }
            self.guests.push(Guest { stream, line: vec![], since: Instant::now() });
        }
    }
}

impl Guest {
    /// The request, or why there is none; nothing while there may be one to come.
    fn listen(&mut self) -> Option<Result<Request, String>> {
        let mut bytes = [0; LINE_BYTES];
        match self.stream.read(&mut bytes) {
            Ok(0) => return Some(Err("no request: a request is one line".into())),
            Ok(count) => self.line.extend_from_slice(&bytes[..count]),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Some(Err(error.to_string())),
        }
        if let Some(end) = self.line.iter().position(|byte| *byte == b'\n') {
            let request = serde_json::from_slice(&self.line[..end]);
            return Some(request.map_err(|error| format!("not a request: {error}")));
        }
        if self.line.len() >= LINE_BYTES {
            return Some(Err(format!("not a request: a line of more than {LINE_BYTES} bytes")));
        }
        (self.since.elapsed() > PATIENCE).then(|| Err(format!("no request within {} s", PATIENCE.as_secs())))
    }
}

impl Reply {
    /// Who has asked.
    pub fn sender(&self) -> Option<Sender> {
        peer_of(&self.0).map(|(pid, user)| Sender { pid, user })
    }

    /// Tells the guest, and shows it out.
    pub fn send(mut self, response: &Response) {
        let line = serde_json::to_string(response).unwrap_or_default() + "\n";
        // Fails for a guest that has gone, or lets its side of the socket run full.
        let _ = self.0.write_all(line.as_bytes());
    }
}

#[cfg(test)]
mod tests;
