//! Launcher's side of the socket. No function here waits or takes long: a look takes at most one request, and a client
//! that connects and sends nothing is disconnected.

use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::Instant;

use runtime::domain::Domain;
use runtime::realtime::peer_of;

use super::{ControlRequest, Response, SOCKET};
use crate::event::Sender;
use crate::limits::{CLIENTS, NEW_CLIENTS, REQUEST_BYTES, REQUEST_LIMIT};

/// Socket, and its clients.
pub struct Server {
    listener: UnixListener,
    clients: Vec<Client>,
    /// `true` if the last look found a request.
    served: bool,
}

/// Client that has not finished a line yet.
struct Client {
    stream: UnixStream,
    line: Vec<u8>,
    since: Instant,
}

pub struct Reply(UnixStream);

impl Server {
    pub fn open(domain: &Domain) -> io::Result<Self> {
        let listener = UnixListener::bind(domain.file(SOCKET))?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener, clients: vec![], served: false })
    }

    /// Returns the descriptors that become readable when a client connects or sends; none after a request. The next
    /// request is taken at the next look at the processes, so that clients cannot make the launcher look more often.
    pub fn sources(&self) -> impl Iterator<Item = BorrowedFd<'_>> {
        let all = [self.listener.as_fd()].into_iter().chain(self.clients.iter().map(|client| client.stream.as_fd()));
        all.filter(|_| !self.served)
    }

    /// Returns a request that has arrived, and the [`Reply`] for its answer; `None` if there is no request. A client
    /// without a valid request gets an error and is disconnected.
    pub fn request(&mut self) -> Option<(ControlRequest, Reply)> {
        self.accept_new();
        self.served = false;
        let mut i = 0;
        while let Some(client) = self.clients.get_mut(i) {
            let Some(received) = client.listen() else {
                i += 1;
                continue;
            };
            let reply = Reply(self.clients.remove(i).stream);
            match received {
                Ok(request) => {
                    self.served = true;
                    return Some((request, reply));
                }
                Err(why) => reply.send(&Response::Error(why)),
            }
        }
        None
    }

    fn accept_new(&mut self) {
        for _ in 0..NEW_CLIENTS {
            let Ok((stream, _)) = self.listener.accept() else { break };
            if stream.set_nonblocking(true).is_err() {
                continue;
            }
            if self.clients.len() == CLIENTS {
                let oldest = Reply(self.clients.remove(0).stream);
                oldest.send(&Response::Error(format!("no request, and {CLIENTS} others have come since")));
            }
            self.clients.push(Client { stream, line: vec![], since: Instant::now() });
        }
    }
}

impl Client {
    /// Reads the request, or returns the reason why there is none; `None` while a request may still arrive.
    fn listen(&mut self) -> Option<Result<ControlRequest, String>> {
        let mut bytes = [0; REQUEST_BYTES];
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
        if self.line.len() >= REQUEST_BYTES {
            return Some(Err(format!("not a request: a line of more than {REQUEST_BYTES} bytes")));
        }
        (self.since.elapsed() > REQUEST_LIMIT).then(|| Err(format!("no request within {} s", REQUEST_LIMIT.as_secs())))
    }
}

impl Reply {
    /// Returns the process that sent the request; `None` if the kernel does not name it.
    pub fn sender(&self) -> Option<Sender> {
        peer_of(&self.0).map(|(pid, user)| Sender { pid, user })
    }

    /// Sends the answer, and closes the connection.
    pub fn send(mut self, response: &Response) {
        let line = serde_json::to_string(response).unwrap_or_default() + "\n";
        // The write fails if the client has gone, or if its side of the socket is full.
        let _ = self.0.write_all(line.as_bytes());
    }
}

#[cfg(test)]
mod tests;
