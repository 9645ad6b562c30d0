use std::io::{BufRead, BufReader};

use serde_json::json;

use super::*;

/// Opens a server in a folder of its own.
fn open() -> (tempfile::TempDir, Domain, Server) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let domain = Domain { folder: folder.path().to_owned() };
    let server = Server::open(&domain).expect("a socket");
    (folder, domain, server)
}

fn enter(domain: &Domain) -> UnixStream {
    UnixStream::connect(domain.file(SOCKET)).expect("the door is open")
}

fn told(stream: UnixStream) -> Response {
    let mut line = String::new();
    BufReader::new(stream).read_line(&mut line).expect("an answer");
    serde_json::from_str(&line).expect("an answer is JSON")
}

#[test]
fn a_request_may_come_in_pieces_and_its_sender_gets_the_answer() {
    let (_folder, domain, mut server) = open();
    assert!(server.request().is_none());
    let (silent, mut client) = (enter(&domain), enter(&domain));
    client.write_all(b"\"sta").expect("written");
    assert!(server.request().is_none());
    client.write_all(b"tus\"\nmore").expect("written");
    let (request, reply) = server.request().expect("a request");
    assert_eq!(request, ControlRequest::Status);
    reply.send(&Response::Ok(json!(7)));
    assert_eq!(told(client), Response::Ok(json!(7)));
    assert_eq!(server.sources().count(), 0, "one at a look");
    assert!(server.request().is_none());
    assert_eq!(server.sources().count(), 2, "the door, and who has not spoken yet");
    drop(silent);
    assert!(server.request().is_none());
    assert_eq!(server.sources().count(), 1);
}

#[test]
fn an_invalid_request_gets_an_error() {
    for (line, expected) in [
        (&b"\n"[..], "not a request"),
        (b"{\"fly\":1}\n", "unknown variant `fly`"),
        (b"\xff\xfe\x00\n", "not a request"),
        (&[b'x'; REQUEST_BYTES + 1], "a line of more than 4096 bytes"),
    ] {
        let (_folder, domain, mut server) = open();
        let mut client = enter(&domain);
        client.write_all(line).expect("written");
        assert!(server.request().is_none());
        let Response::Error(why) = told(client) else { panic!("{line:?} was taken") };
        assert!(why.contains(expected), "{why}");
    }
}

#[test]
fn a_silent_client_is_disconnected() {
    let (_folder, domain, mut server) = open();
    let silent = enter(&domain);
    assert!(server.request().is_none());
    server.clients.iter_mut().for_each(|client| client.since -= REQUEST_LIMIT);
    assert!(server.request().is_none());
    assert_eq!(told(silent), Response::Error("no request within 1 s".into()));
}

#[test]
fn a_thousand_silent_clients_do_not_keep_others_out() {
    let (_folder, domain, mut server) = open();
    let mut silent = vec![];
    for _ in 0..50 {
        silent.extend((0..20).map(|_| enter(&domain)));
        let mut client = enter(&domain);
        client.write_all(b"\"status\"\n").expect("written");
        let looks = (1..=4).find(|_| server.request().is_some());
        assert!(looks.is_some(), "after {} silent clients nobody is answered", silent.len());
        assert!(server.clients.len() <= CLIENTS);
    }
    let Response::Error(why) = told(silent.swap_remove(0)) else { panic!("nothing was asked") };
    assert!(why.contains("others have come since"), "{why}");
}

#[test]
fn the_kernel_names_the_sender_of_a_request() {
    let (_folder, domain, mut server) = open();
    enter(&domain).write_all(b"\"status\"\n").expect("written");
    let (_, reply) = server.request().expect("a request");
    let user = rustix::process::geteuid().as_raw();
    assert_eq!(reply.sender(), Some(Sender { pid: std::process::id() as i32, user }));
}
