//! The live page: its frames, its buttons, who may connect, and clients that misbehave.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use flight::log::Lz4;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};
use view::scene::SceneChannel;

use crate::control::{flying, status, tell};
use crate::harness::{
    AS_NOBODY, Flight, Outcome, PATIENT, fly, has_root, launcher, namespace, shared_memory_of, wait_until,
};
use crate::pages;
use crate::processes::{children_of, kill, niceness};

/// Setting without which a vehicle does not feel the wind.
const DRAG: &str = "plant.drag_linear_nspm=[0.2, 0.2, 0.1]";
const TOKEN: &str = "0123456789abcdef";
/// The token in a header, and in the addresses of the websockets.
const BEARER: &str = "Authorization: Bearer 0123456789abcdef";
const PAGE: &str = "/ws?token=0123456789abcdef";
const FOXGLOVE: &str = "/foxglove?token=0123456789abcdef";
/// Content type of an order.
const JSON: &str = "Content-Type: application/json";

type Socket = WebSocket<TcpStream>;

/// Returns a TCP port that no process has opened.
fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a free port").port()
}

/// Starts a flight with its page; returns when the page has joined.
fn with_page(namespace: &str, port: u16, settings: &[&str]) -> Flight {
    let address = format!("127.0.0.1:{port}");
    let flight = flying(namespace, &[&["--web", &address, "--token", TOKEN], settings].concat());
    // The page's process has a low priority, so under load it joins after the command line.
    frame(&mut open(port, PAGE, &[]).expect("it opens"), is("flight"));
    flight
}

/// Running `trefoil web` for a namespace. Drop kills it.
struct Server(Child);

impl Server {
    fn start(namespace: &str, port: u16) -> Self {
        let mut command = launcher();
        command.args(["web", "--namespace", namespace, &format!("127.0.0.1:{port}"), "--token", TOKEN]);
        let server = Self(command.stderr(Stdio::null()).spawn().expect("it starts"));
        wait_until("the port is open", || TcpStream::connect(("127.0.0.1", port)).is_ok());
        server
    }

    /// Starts the server at `host` without a given token; returns it with the token that it prints.
    fn with_own_token(namespace: &str, host: &str, port: u16) -> (Self, String) {
        let mut command = launcher();
        command.args(["web", "--namespace", namespace, &format!("{host}:{port}")]).stderr(Stdio::piped());
        let mut server = Self(command.spawn().expect("it starts"));
        let mut line = String::new();
        BufReader::new(server.0.stderr.take().expect("a pipe")).read_line(&mut line).expect("a line");
        let address = format!("live page: http://{host}:{port}/?token=");
        let token = line.trim_end().strip_prefix(&address).unwrap_or_else(|| panic!("no token: {line}")).to_owned();
        wait_until("the port is open", || TcpStream::connect(("127.0.0.1", port)).is_ok());
        (server, token)
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.0.kill().expect("it runs");
        self.0.wait().expect("it has ended");
    }
}

/// Sends a request with `headers` and a `body`; returns status code and answer, header included.
fn ask(port: u16, request: &str, headers: &[&str], body: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("the port is open");
    stream.set_read_timeout(Some(Duration::from_secs(30))).expect("a time-out");
    let host = if headers.iter().any(|header| header.starts_with("Host:")) {
        String::new()
    } else {
        format!("Host: 127.0.0.1:{port}\r\n")
    };
    let headers = headers.iter().fold(String::new(), |all, header| all + header + "\r\n");
    let length = body.len();
    write!(stream, "{request} HTTP/1.1\r\n{host}{headers}Content-Length: {length}\r\nConnection: close\r\n\r\n{body}")
        .expect("it is sent");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("an answer");
    let code = answer.split(' ').nth(1).and_then(|code| code.parse().ok());
    (code.unwrap_or_else(|| panic!("no answer: {answer}")), answer)
}

/// Sends an order of the page; returns its answer.
fn order(port: u16, order: &Value) -> Value {
    let (code, answer) = ask(port, "POST /command", &[JSON, BEARER], &order.to_string());
    assert_eq!(code, 200, "{answer}");
    serde_json::from_str(answer.split_once("\r\n\r\n").expect("a body").1).expect("JSON")
}

/// Opens a websocket, with `headers` besides the required ones.
fn open(port: u16, path: &str, headers: &[(&'static str, &str)]) -> Result<Socket, Box<tungstenite::Error>> {
    let mut request = format!("ws://127.0.0.1:{port}{path}").into_client_request().expect("an address");
    for (name, value) in headers {
        request.headers_mut().insert(*name, value.parse().expect("a header"));
    }
    let stream = TcpStream::connect(("127.0.0.1", port)).expect("the port is open");
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a time-out");
    match tungstenite::client(request, stream) {
        Ok((socket, _)) => Ok(socket),
        Err(tungstenite::HandshakeError::Failure(error)) => Err(Box::new(error)),
        Err(tungstenite::HandshakeError::Interrupted(_)) => panic!("no answer to the handshake"),
    }
}

/// Returns the code with which a websocket is refused.
fn refused(port: u16, path: &str, headers: &[(&'static str, &str)]) -> u16 {
    match open(port, path, headers).map_err(|error| *error) {
        Err(tungstenite::Error::Http(response)) => response.status().as_u16(),
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("{path} {headers:?} is let in"),
    }
}

/// Reads frames until one fits.
fn frame(socket: &mut Socket, fits: impl Fn(&Value) -> bool) -> Value {
    for _ in 0..100_000 {
        if let Message::Text(text) = socket.read().expect("a frame") {
            let frame: Value = serde_json::from_str(&text).expect("JSON");
            if fits(&frame) {
                return frame;
            }
        }
    }
    panic!("no frame fits");
}

fn is(kind: &str) -> impl Fn(&Value) -> bool {
    move |frame| frame["kind"] == kind
}

#[test]
fn a_page_shows_its_flight_and_says_when_it_ends() {
    let (ns, port) = (namespace(), free_port());
    let flight = with_page(&ns, port, &["--set", "run.duration_s=20.0", "--set", DRAG]);
    let (code, page) = ask(port, "GET /", &[BEARER], "");
    assert!(
        code == 200 && page.contains("<title>Live flight</title>") && page.contains("script-src 'nonce-"),
        "{code}"
    );
    let mut socket = open(port, PAGE, &[("origin", &format!("http://127.0.0.1:{port}"))]).expect("its own page");
    let told = frame(&mut socket, is("flight"));
    assert_eq!((&told["namespace"], &told["duration_s"]), (&json!(ns), &json!(20.0)));
    let columns = told["columns"].as_array().expect("columns").len();
    let rows = frame(&mut socket, is("rows"));
    let rows = rows["rows"].as_array().expect("rows");
    assert!(rows.iter().all(|row| row.as_array().map(Vec::len) == Some(columns + 1)), "{rows:?}");
    assert!(rows[0][0].as_f64() < Some(10.0), "it joined at the start: {}", rows[0]);
    let nodes = frame(&mut socket, |frame| frame["kind"] == "status" && frame["nodes"][3]["epoch"] == 1);
    assert_eq!(nodes["nodes"][2]["node"], "attitude-mpc");
    let timing = frame(&mut socket, |frame| frame["kind"] == "timing" && frame["time_s"].as_f64() > Some(1.0));
    assert!(timing["timing"]["nodes"][3]["figures_us"][2][1].as_f64() > Some(0.0), "{timing}");
    tell(&ns, &["inject", "wind", "step", "--vector", "2,0,0", "--for", "1s"]).expect("it flies");
    let happened = frame(&mut socket, |frame| frame["kind"] == "happened" && frame["events"][0]["node"] == "wind");
    let what = happened["events"][0]["what"].as_str().expect("words");
    assert!(what.starts_with("injected step"), "{what}");
    frame(&mut socket, |frame| {
        let rows = frame["rows"].as_array().map_or(&[][..], Vec::as_slice);
        rows.iter().any(|row| row[columns - 2].as_f64() == Some(2.0)) // the north wind
    });
    let end = frame(&mut socket, |frame| frame["kind"] == "phase" && frame["phase"] == "ended");
    assert_eq!(end["why"], "the flight has ended");
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    assert!(
        outcome.stderr.contains(&format!("live page: http://127.0.0.1:{port}/?token={TOKEN}\n")),
        "{}",
        outcome.stderr
    );
    assert!(TcpStream::connect(("127.0.0.1", port)).is_err(), "the page's process has ended with the flight");
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn buttons_do_what_the_command_line_does_and_say_so() {
    let (ns, port) = (namespace(), free_port());
    let flight = with_page(&ns, port, &["--set", "run.duration_s=3600.0", "--set", DRAG]);
    let injected = order(port, &json!({ "command": "inject", "target": "wind", "kind": "step", "for": "inf" }));
    assert_eq!(injected["line"], format!("trefoil inject --namespace={ns} --for=inf wind step"));
    let said = |answer: &Value| answer["said"].as_str().expect("text").to_owned();
    assert!(said(&injected).starts_with("injected: wind step from"), "{injected}");
    let cleared = order(port, &json!({ "command": "clear", "target": "wind" }));
    assert!(cleared["ok"] == true && said(&cleared).starts_with("cleared: wind step"), "{cleared}");
    let unknown = order(port, &json!({ "command": "inject", "target": "rotr1", "kind": "off" }));
    assert!(unknown["ok"] == false && said(&unknown).contains("did you mean `rotor1`?"), "{unknown}");
    let program = order(port, &json!({ "command": "swap", "node": "mixer", "set": ["node.mixer.exec='/bin/true'"] }));
    assert!(program["ok"] == false && said(&program).contains("starts no other program"), "{program}");
    let priority = order(port, &json!({ "command": "swap", "node": "mixer", "set": ["realtime.priority=95"] }));
    let by_hand = "on the command line: trefoil swap NODE --set realtime.priority=95";
    assert!(priority["ok"] == false && said(&priority).contains(by_hand), "{priority}");
    let (code, _) = ask(port, "POST /command", &[JSON, BEARER], r#"{"command":"fly"}"#);
    assert_eq!(code, 422);
    let swapped = order(port, &json!({ "command": "swap", "node": "guidance" }));
    assert!(said(&swapped).contains("guidance epoch 2"), "{swapped}");
    let stopped = order(port, &json!({ "command": "stop" }));
    assert!(stopped["ok"] == true && said(&stopped).starts_with("stopped:"), "{stopped}");
    let outcome = flight.finish();
    let run = outcome.run();
    assert_eq!(run["faults"][0]["target"], "wind");
    let by = |event: &Value| event["what"] == "injected" && event["by"]["pid"].as_u64() > Some(1);
    assert!(run["events"].as_array().expect("events").iter().any(by), "{}", run["events"]);
}

#[test]
fn no_address_answers_without_the_token_also_on_loopback_and_for_reading() {
    for host in ["127.0.0.1", "0.0.0.0"] {
        let (ns, port) = (namespace(), free_port());
        let (server, token) = Server::with_own_token(&ns, host, port);
        let spoken = ("sec-websocket-protocol", "foxglove.sdk.v1");
        for path in ["/", "/ws", "/foxglove", "/command", "/nothing", "/favicon.ico", "//", "/?token=", "/?token=wrong"]
        {
            for method in ["GET", "POST", "PUT", "DELETE", "OPTIONS", "PATCH"] {
                let (code, answer) = ask(port, &format!("{method} {path}"), &[JSON], r#"{"command":"stop"}"#);
                assert!(code == 401 && answer.ends_with("Bearer TOKEN`"), "{method} {path}: {answer}");
                assert!(!answer.to_lowercase().contains("set-cookie"), "{answer}");
            }
            assert_eq!(ask(port, &format!("HEAD {path}"), &[], "").0, 401, "{path}");
            assert_eq!(refused(port, path, &[spoken]), 401, "{path}");
        }
        for header in
            ["Authorization: Bearer wrong", &format!("Authorization: Basic {token}"), &format!("Cookie: {token}")]
        {
            assert_eq!(ask(port, "GET /", &[header], "").0, 401, "{header}");
        }
        assert_eq!(ask(port, &format!("GET /?token={token}"), &[], "").0, 303, "the token that was printed");
        drop(server);
    }
}

#[test]
fn the_token_moves_from_the_address_into_a_cookie_that_opens_everything() {
    let (ns, port) = (namespace(), free_port());
    let server = Server::start(&ns, port);
    let (code, moved) = ask(port, &format!("GET /?token={TOKEN}"), &[], "");
    let header = |name: &str| moved.lines().find_map(|line| line.strip_prefix(name)).map(str::trim);
    assert_eq!((code, header("location:")), (303, Some("/")), "{moved}");
    let set = format!("trefoil-{port}={TOKEN}; HttpOnly; SameSite=Strict; Path=/");
    assert_eq!(header("set-cookie:"), Some(set.as_str()), "{moved}");
    let cookie = format!("theme=dark; trefoil-{port}={TOKEN}");
    let kept = format!("Cookie: {cookie}");
    let (code, page) = ask(port, "GET /", &[&kept], "");
    assert!(code == 200 && page.contains("<title>Live flight</title>") && !page.contains(TOKEN), "{code}");
    assert_eq!(ask(port, "GET /nothing", &[&kept], "").0, 404);
    assert_eq!(ask(port, "POST /command", &[&kept, JSON], r#"{"command":"stop"}"#).0, 200);
    let other = format!("Cookie: trefoil-{}={TOKEN}", port - 1);
    assert_eq!(ask(port, "GET /", &[&other], "").0, 401, "that of another port");
    let spoken = ("sec-websocket-protocol", "foxglove.websocket.v1");
    let own = format!("http://127.0.0.1:{port}");
    for path in ["/ws", "/foxglove"] {
        let headers = [("cookie", cookie.as_str()), ("origin", &own), spoken];
        open(port, path, &headers[..if path == "/ws" { 2 } else { 3 }]).expect("the cookie opens it");
        // To a browser all ports of a host are one site, so it also sends the cookie for a page of another port.
        for origin in ["https://evil.example", "null", "http://127.0.0.1:1"] {
            assert_eq!(refused(port, path, &[("cookie", &cookie), ("origin", origin), spoken]), 403, "{path} {origin}");
        }
    }
    open(port, FOXGLOVE, &[spoken, ("origin", "https://app.foxglove.dev")]).expect("its owner gave it the token");
    assert_eq!(refused(port, PAGE, &[("origin", "https://app.foxglove.dev")]), 403);
    drop(server);
}

#[test]
fn with_the_token_too_another_website_and_a_name_that_is_not_of_loopback_are_refused() {
    let (ns, port) = (namespace(), free_port());
    let server = Server::start(&ns, port);
    let code = |headers: &[&str]| ask(port, "GET /", &[&[BEARER], headers].concat(), "").0;
    assert_eq!([code(&[]), code(&[&format!("Host: localhost:{port}")])], [200, 200]);
    assert_eq!([code(&["Host: evil.example"]), code(&[&format!("Host: evil.example:{port}")])], [403, 403]);
    assert_eq!(code(&["Origin: https://evil.example"]), 403);
    for path in [PAGE, FOXGLOVE] {
        let spoken = ("sec-websocket-protocol", "foxglove.sdk.v1");
        assert_eq!(refused(port, path, &[("host", "evil.example"), spoken]), 403);
    }
    let stop = r#"{"command":"stop"}"#;
    assert_eq!(ask(port, "POST /command", &[BEARER, JSON, "Origin: https://evil.example"], stop).0, 403);
    // A form of another website can send no JSON.
    assert_eq!(ask(port, "POST /command", &[BEARER, "Content-Type: text/plain"], stop).0, 415);
    assert_eq!(ask(port, "POST /command", &[BEARER, JSON], &" ".repeat(20_000)).0, 413);
    assert_eq!(ask(port, "GET /nothing", &[BEARER], "").0, 404);
    assert_eq!(ask(port, "GET /nothing", &[BEARER, "Host: evil.example"], "").0, 403, "no path is left out");
    drop(server);
}

/// Script that reads the page, opens its websocket and sends orders. Makes each attempt ten times in connections that
/// it closes at once, so that some have ended when the server looks at them. Then makes each attempt ten times, waits
/// for the answer, and prints its first line. `PORT` is the port.
const ATTACK: &str = r#"
look() { printf 'GET %s HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\n%b\r\n' "$1" "$2" >&3; }
order() {
  printf 'POST /command HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nContent-Type: application/json\r\nConnection: close\r\n' >&3
  printf 'Content-Length: %d\r\n\r\n%s' ${#1} "$1" >&3
}
page() { look / 'Connection: close\r\n'; }
socket() {
  look /ws 'Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\n'
}
inject() { order '{"command":"inject","target":"payload","kind":"mass","for":"1s"}'; }
stop() { order '{"command":"stop"}'; }
for attempt in page socket inject stop; do
  for fd in {10..19}; do eval "exec $fd<>/dev/tcp/127.0.0.1/PORT"; done
  for fd in {10..19}; do $attempt 3>&$fd; eval "exec $fd>&-"; done
  for round in {0..9}; do exec 3<>/dev/tcp/127.0.0.1/PORT; $attempt; head -1 <&3; exec 3>&-; done
done
"#;

#[test]
fn another_user_neither_reads_nor_commands_the_flight_of_a_page_on_loopback() {
    if !has_root() {
        return;
    }
    let (ns, port) = (namespace(), free_port());
    let address = format!("127.0.0.1:{port}");
    let flight = flying(&ns, &["--web", &address, "--set", "run.duration_s=3600.0"]);
    let words: Vec<&str> = AS_NOBODY.split(' ').collect();
    let mut attack = Command::new(words[0]);
    attack.args(&words[1..]).args(["timeout", "60", "bash", "-c", &ATTACK.replace("PORT", &port.to_string())]);
    let output = attack.output().expect("bash runs");
    let [told, failed] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    tell(&ns, &["stop"]).unwrap_or_else(|error| panic!("the flight was stopped: {error} {told} {failed}"));
    let run = flight.finish().run();
    assert!(run["faults"] == json!([]) && run["events"] == json!([]), "{} {}", run["faults"], run["events"]);
    let answers: Vec<&str> = told.lines().map(str::trim_end).collect();
    assert_eq!(answers, ["HTTP/1.1 401 Unauthorized"; 40], "{failed}");
}

#[test]
fn a_frame_that_is_too_long_ends_its_connection_before_it_is_read() {
    let (ns, port) = (namespace(), free_port());
    let server = Server::start(&ns, port);
    let spoken = ("sec-websocket-protocol", "foxglove.sdk.v1");
    for path in [PAGE, FOXGLOVE] {
        let spoken: &[_] = if path == FOXGLOVE { &[spoken] } else { &[] };
        let mut socket = open(port, path, spoken).expect("it opens");
        // Header of a binary, masked frame of 15 MB, whose payload never comes.
        let header = [&[0x82, 0xff][..], &15_000_000_u64.to_be_bytes(), &[0; 4]].concat();
        socket.get_mut().write_all(&header).expect("it is sent");
        let mut rest = vec![];
        if let Err(error) = socket.get_mut().read_to_end(&mut rest) {
            assert_eq!(error.kind(), std::io::ErrorKind::ConnectionReset, "{path}: still open");
        }
    }
    drop(server);
}

#[test]
fn a_page_that_is_stopped_or_killed_is_a_reservation_and_the_flight_ends() {
    for (signal, told) in [("-STOP", "did not end and was killed"), ("-KILL", "failed (signal: 9")] {
        let (ns, port) = (namespace(), free_port());
        let flight = with_page(&ns, port, &["--set", "run.duration_s=20.0"]);
        let pages = children_of(flight.child.id(), "serve-page");
        assert!(pages.len() == 1 && niceness(pages[0]) == 10, "{pages:?}");
        kill(signal, &pages);
        let outcome = flight.finish(); // though a stopped page does not end
        let run = outcome.run();
        assert_eq!((outcome.code(), &run["exit_code"]), (Some(0), &json!(0)), "{}", outcome.stderr);
        let expected = format!("the process of --web {told}");
        assert!(run["reservations"].to_string().contains(&expected), "{}", run["reservations"]);
    }
}

#[test]
fn twenty_browsers_one_that_does_not_read_and_a_page_that_is_killed_cost_the_flight_nothing() {
    let (ns, port) = (namespace(), free_port());
    let flight = flying(&ns, &["--set", "run.duration_s=3600.0"]);
    let server = Server::start(&ns, port);
    let sleeping = open(port, PAGE, &[]).expect("it opens");
    let spoken = ("sec-websocket-protocol", "foxglove.sdk.v1");
    let mut unread = open(port, FOXGLOVE, &[spoken]).expect("it opens");
    let all: Vec<Value> = (0..6).map(|channel| json!({ "id": channel, "channelId": channel })).collect();
    let subscribe = json!({ "op": "subscribe", "subscriptions": all });
    unread.send(Message::text(subscribe.to_string())).expect("it is sent");
    let mut browsers: Vec<Socket> = (0..20).map(|_| open(port, PAGE, &[]).expect("it opens")).collect();
    for browser in &mut browsers {
        let told = frame(browser, is("flight"));
        assert_eq!(told["namespace"], json!(ns));
        frame(browser, is("rows"));
    }
    // A browser that reloads gets the last minute again.
    frame(&mut browsers.pop().expect("twenty"), is("rows")); // its second frame of rows
    let mut again = open(port, PAGE, &[]).expect("it opens");
    let rows = frame(&mut again, is("rows"));
    assert!(rows["rows"].as_array().map(Vec::len) > Some(1), "the rows since the page joined");
    drop(server); // by SIGKILL, while it serves
    // The place of the killed server is free, and the ring was not disturbed.
    let server = Server::start(&ns, port);
    let mut socket = open(port, PAGE, &[]).expect("it opens");
    frame(&mut socket, is("rows"));
    tell(&ns, &["stop"]).expect("it flies");
    let end = frame(&mut socket, |frame| frame["kind"] == "phase" && frame["phase"] == "ended");
    assert_eq!(end["why"], "the flight has ended");
    let run = flight.finish().run();
    assert!(run["exit_code"] == 130 && run["events"] == json!([]), "{}", run["events"]);
    drop((sleeping, unread, browsers));

    // The server keeps the last state for new browsers, and shows the next flight.
    let mut late = open(port, PAGE, &[]).expect("it opens");
    assert_eq!(frame(&mut late, is("phase"))["phase"], "ended");
    let next = flying(&ns, &["--set", "run.duration_s=3600.0"]);
    frame(&mut late, is("flight"));
    frame(&mut late, |frame| frame["phase"] == "flying");
    tell(&ns, &["stop"]).expect("it ends");
    assert_eq!(next.finish().code(), Some(130));
    frame(&mut late, |frame| frame["phase"] == "ended");
    drop(server);
    wait_until("nothing is left in shared memory", || shared_memory_of(&ns).is_empty());
}

#[test]
fn foxglove_gets_the_channels_of_the_log_with_their_bytes() {
    let (ns, port) = (namespace(), free_port());
    let flight = with_page(&ns, port, &["--set", "run.duration_s=3600.0"]);
    assert_eq!(refused(port, FOXGLOVE, &[]), 400, "a client that does not speak the protocol");
    for protocol in ["foxglove.sdk.v1", "foxglove.websocket.v1"] {
        let mut socket = open(port, FOXGLOVE, &[("sec-websocket-protocol", protocol)]).expect("it is spoken");
        let text = |socket: &mut Socket| frame(socket, |_| true);
        let info = text(&mut socket);
        assert!(info["op"] == "serverInfo" && info["name"].as_str().is_some_and(|name| name.contains(&ns)), "{info}");
        let channels = text(&mut socket);
        let ours = channels["channels"].as_array().expect("channels");
        let topics: Vec<&str> = ours.iter().filter_map(|channel| channel["topic"].as_str()).collect();
        assert!(
            topics.starts_with(&["/state", "/reference", "/controls", "/actuators", "/truth", "/events"]),
            "{topics:?}"
        );
        let subscribe = json!({ "op": "subscribe", "subscriptions": [{ "id": 7, "channelId": ours[0]["id"] }] });
        socket.send(Message::text(subscribe.to_string())).expect("it is sent");
        let mut before = None;
        for _ in 0..20 {
            let Message::Binary(bytes) = socket.read().expect("a message") else { continue };
            let (header, message) = bytes.split_at(13);
            assert_eq!(header[..5], [1, 7, 0, 0, 0]);
            let log_time_ns = u64::from_le_bytes(header[5..].try_into().expect("eight bytes"));
            // Field 1 of State is the stamp, after its length; field 1 of the stamp is the tick.
            let (_, length) = varint(&message[1..]);
            let stamp = &message[1 + length..];
            assert_eq!((message[0], stamp[0], varint(&stamp[1..]).0 * 10_000_000), (0x0a, 0x08, log_time_ns));
            assert!(before.is_none_or(|before| log_time_ns > before), "{before:?} {log_time_ns}");
            before = Some(log_time_ns);
        }
        assert!(before.is_some(), "messages came");
        socket.send(Message::text(r#"{"op":"unsubscribe","subscriptionIds":[7]}"#)).expect("it is sent");
        socket.send(Message::text(r#"{"op":"getParameters"}"#)).expect("it is sent");
        assert_eq!(frame(&mut socket, |_| true)["op"], "status", "what it cannot do it says");
    }
    tell(&ns, &["stop"]).expect("it ends");
    assert_eq!(flight.finish().code(), Some(130));
}

#[test]
fn foxglove_gets_the_vehicle_and_its_scene_as_the_export_has_them() {
    let (ns, port) = (namespace(), free_port());
    let address = format!("127.0.0.1:{port}");
    let page = ["--web", &address, "--token", TOKEN, "--set", "run.duration_s=20.0", "--set", PATIENT];
    let flight = Flight::start(&ns, &page);
    wait_until("the stack flies", || status(&ns)["time_s"].as_f64() > Some(0.2));
    frame(&mut open(port, PAGE, &[]).expect("it opens"), is("phase")); // the page has joined
    let spoken = ("sec-websocket-protocol", "foxglove.sdk.v1");
    let mut socket = open(port, FOXGLOVE, &[spoken]).expect("it is spoken");
    let advertised = frame(&mut socket, |frame| frame["op"] == "advertise");
    let topic = |channel: &Value| channel["topic"].as_str().expect("a topic").to_owned();
    let channels: Vec<(String, u64)> = advertised["channels"]
        .as_array()
        .expect("channels")
        .iter()
        .filter(|channel| topic(channel).starts_with("/view/"))
        .map(|channel| (topic(channel), channel["id"].as_u64().expect("a number")))
        .collect();
    let known: Vec<&str> = channels.iter().map(|(topic, _)| topic.as_str()).collect();
    assert_eq!(known, SceneChannel::ALL.map(SceneChannel::topic));
    // The number of a subscription is the index of its topic.
    let all = channels.iter().enumerate().map(|(id, (_, channel))| json!({ "id": id, "channelId": channel }));
    let subscribe = json!({ "op": "subscribe", "subscriptions": all.collect::<Vec<_>>() });
    socket.send(Message::text(subscribe.to_string())).expect("it is sent");
    let mut seen: Vec<(String, u64, Vec<u8>, Vec<u8>)> = vec![];
    while let Ok(message) = socket.read() {
        if let Message::Binary(bytes) = message {
            let (header, message) = bytes.split_at(13);
            let log_time_ns = u64::from_le_bytes(header[5..].try_into().expect("eight bytes"));
            let topic = channels[usize::from(header[1])].0.clone();
            let (head, poses) = comparable(&topic, message);
            seen.push((topic, log_time_ns, head, poses));
        }
    }
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let exported = launcher().arg("export").arg(&outcome.out).args(["--to", "foxglove"]).status();
    assert!(exported.expect("the launcher runs").success());
    let file = std::fs::read(outcome.out.join("foxglove.mcap")).expect("a log");
    let mut log = mcap::io::MessageReader::new(&file[..]);
    log.add_decompressor(Lz4::default()).expect("a name");
    let logged: BTreeMap<(String, u64), (Vec<u8>, Vec<u8>)> = log
        .map(|message| message.expect("a message"))
        .filter(|message| message.channel.topic.starts_with("/view/"))
        .map(|message| {
            ((message.channel.topic.clone(), message.log_time), comparable(&message.channel.topic, &message.data))
        })
        .collect();
    let is_logged = |topic: &str, ns: u64, head: &[u8], poses: &[u8]| {
        logged.get(&(topic.to_owned(), ns)).is_some_and(|of| of.0 == head && of.1.ends_with(poses))
    };
    let others: Vec<_> = seen
        .iter()
        .filter(|(topic, ns, head, poses)| !is_logged(topic, *ns, head, poses))
        .map(|(topic, ns, ..)| (topic, ns))
        .collect();
    assert!(others.is_empty(), "not in the export: {others:?}");
    let count = |topic: SceneChannel| seen.iter().filter(|(of, ..)| of == topic.topic()).count();
    for fixed in [SceneChannel::FixedFrames, SceneChannel::Vehicle, SceneChannel::Course] {
        assert_eq!(count(fixed), 1, "{fixed:?} comes with the subscription");
    }
    let counts = [SceneChannel::Frames, SceneChannel::Arrows, SceneChannel::Path].map(count);
    assert!(counts[0] > 50 && counts[1] > 25 && counts[2] >= 1, "{counts:?}");
}

/// Returns the parts of a view message on which two readers must agree. A path has its poses apart, because a reader
/// that came later lacks the first ones. Frames are cut to `body` and `rotor_1`, the first two, because another reader
/// of the ring may have seen the next reference already.
fn comparable(topic: &str, message: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let after = |from: usize| {
        let (length, width) = varint(&message[from + 1..]);
        from + 1 + width + length as usize
    };
    let second = || after(after(0));
    if topic == SceneChannel::Frames.topic() {
        (message[..second()].to_vec(), vec![])
    } else if topic == SceneChannel::Path.topic() {
        let (head, poses) = message.split_at(second());
        (head.to_vec(), poses.to_vec())
    } else {
        (message.to_vec(), vec![])
    }
}

/// Reads a number of protobuf; returns it with its length.
fn varint(bytes: &[u8]) -> (u64, usize) {
    let length = bytes.iter().position(|byte| byte & 0x80 == 0).expect("an end") + 1;
    let number = bytes[..length].iter().rev().fold(0, |number, byte| number << 7 | u64::from(byte & 0x7f));
    (number, length)
}

/// Running `trefoil replay --web` of a run. Drop kills it.
struct Replay {
    child: Child,
    port: u16,
}

impl Replay {
    fn start(run: &Path, more: &[&str]) -> Self {
        let port = free_port();
        let mut command = launcher();
        command.arg("replay").arg(run).args(["--web", &format!("127.0.0.1:{port}"), "--token", TOKEN]).args(more);
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
        Self { child, port }
    }

    /// Opens the page's websocket, which answers once the log is read.
    fn page(&self) -> Socket {
        wait_until("the port is open", || TcpStream::connect(("127.0.0.1", self.port)).is_ok());
        open(self.port, PAGE, &[]).expect("it opens")
    }

    /// Interrupts the replay as by Ctrl-C; returns its exit code and what it printed.
    fn interrupt(mut self) -> (Option<i32>, String) {
        kill_process(Pid::from_child(&self.child), Signal::INT).expect("it runs");
        let mut told = String::new();
        self.child.stdout.take().expect("a pipe").read_to_string(&mut told).expect("text");
        self.child.stderr.take().expect("a pipe").read_to_string(&mut told).expect("text");
        (self.child.wait().expect("it ends").code(), told)
    }
}

impl Drop for Replay {
    fn drop(&mut self) {
        let _ = self.child.kill(); // it has ended already, in tests that pass
        let _ = self.child.wait();
    }
}

/// Flies in lockstep, while the mixer is killed and guidance replaced.
fn eventful() -> Outcome {
    fly(&[
        "--mode",
        "lockstep",
        "--set",
        "run.duration_s=12.0",
        "--set=fault=[{ at_s = 3.0, target = \"mixer\", kind = \"kill\" }]",
        "--set=swap=[{ at_s = 6.0, node = \"guidance\" }]",
    ])
}

/// Returns the newest time of a frame of rows.
fn newest_s(rows: &Value) -> f64 {
    rows["rows"].as_array().and_then(|rows| rows.last()?[0].as_f64()).expect("a time")
}

#[test]
fn a_recorded_flight_plays_pauses_and_jumps_as_it_is_told() {
    let flown = eventful();
    let replay = Replay::start(&flown.out, &[]);
    let port = replay.port;
    let mut socket = replay.page();
    let told = frame(&mut socket, is("flight"));
    assert_eq!((&told["begin_s"], &told["end_s"]), (&json!(0.0), &json!(12.0)), "{told}");
    let (code, page) = ask(port, "GET /", &[BEARER], "");
    assert!(code == 200 && page.contains("Recorded flight") && page.contains("id=\"player\""), "{code}");
    assert!(!page.contains("id=\"inject\"") && !page.contains("id=\"stop\""), "no button that cannot act");
    let done = |body: Value| {
        let answer = order(port, &body);
        assert_eq!(answer["ok"], true, "{body}: {answer}");
    };
    frame(&mut socket, |frame| frame["phase"] == "playing"); // with the first browser
    frame(&mut socket, |frame| frame["kind"] == "position" && frame["position_s"].as_f64() > Some(0.2));
    done(json!({ "command": "pause" }));
    done(json!({ "command": "seek", "time_s": 0.0 }));
    frame(&mut socket, |frame| frame["anew"] == true && newest_s(frame) == 0.0);
    done(json!({ "command": "seek", "time_s": 11.0 }));
    let there = frame(&mut socket, |frame| frame["anew"] == true && newest_s(frame) == 11.0);
    assert_eq!(there["rows"].as_array().map(Vec::len), Some(221), "from the beginning on");
    let late = frame(&mut socket, is("status"));
    let node = |status: &Value, node: usize| status["nodes"][node].clone();
    assert_eq!((&node(&late, 3)["epoch"], &node(&late, 3)["restarts"]), (&json!(2), &json!(1)), "the mixer: {late}");
    assert_eq!((&node(&late, 1)["epoch"], &node(&late, 1)["restarts"]), (&json!(2), &json!(0)), "guidance: {late}");
    assert!(node(&late, 3)["pid"].is_null() && node(&late, 3)["age_ms"].is_null(), "not in a log: {late}");
    let happened = frame(&mut socket, is("happened"));
    assert!(happened["absences"][0]["to_s"].as_f64() > Some(3.0), "{happened}");
    // Seeking backwards removes the later rows.
    done(json!({ "command": "seek", "time_s": 3.0 }));
    let back = frame(&mut socket, |frame| frame["anew"] == true && newest_s(frame) == 3.0);
    assert_eq!(back["rows"].as_array().map(Vec::len), Some(61));
    let early = frame(&mut socket, |frame| frame["kind"] == "status" && node(frame, 1)["epoch"] == 1);
    assert_eq!(node(&early, 1)["standby"], Value::Null, "{early}");
    let happened = frame(&mut socket, is("happened"));
    assert!(
        happened["events"].as_array().is_some_and(|all| all.iter().all(|event| event["at_s"].as_f64() <= Some(3.0)))
    );
    // A second browser sees the same at once.
    let position = frame(&mut socket, is("position"));
    assert_eq!(position, json!({ "kind": "position", "position_s": 3.0, "speed": 1.0, "playing": false }));
    let mut other = open(port, PAGE, &[]).expect("it opens");
    assert_eq!(newest_s(&frame(&mut other, is("rows"))), 3.0);
    assert_eq!(frame(&mut other, is("position")), position);
    done(json!({ "command": "speed", "speed": 20 }));
    done(json!({ "command": "play" }));
    let end = frame(&mut other, |frame| frame["kind"] == "phase" && frame["phase"] == "at the end");
    assert_eq!(end["why"], Value::Null);
    let (code, told) = replay.interrupt();
    assert!(code == Some(0) && told.contains("the same bits") && told.contains("until Ctrl-C"), "{code:?}: {told}");
}

#[test]
fn wrong_orders_to_a_replay_are_refused_with_words_and_those_of_the_other_kind_too() {
    let flown = fly(&["--mode", "inprocess", "--set", "run.duration_s=2.0"]);
    let replay = Replay::start(&flown.out, &[]);
    let port = replay.port;
    wait_until("the port is open", || TcpStream::connect(("127.0.0.1", port)).is_ok());
    let post = "POST /command";
    for (body, expected) in [
        (r#"{"command":"seek","time_s":2.5}"#, "it goes from 0.00 to 2.00 s"),
        (r#"{"command":"seek","time_s":-1}"#, "is not in what is played"),
        (r#"{"command":"speed","speed":0}"#, "0 is no speed: it goes from 0.1 to 20"),
        (r#"{"command":"speed","speed":20.5}"#, "times real time"),
        (r#"{"command":"speed","speed":-1}"#, "times real time"),
    ] {
        let (code, answer) = ask(port, post, &[JSON, BEARER], body);
        assert!(code == 200 && answer.contains(r#""ok":false"#) && answer.contains(expected), "{body}: {answer}");
    }
    for body in [r#"{"command":"stop"}"#, r#"{"command":"seek"}"#, r#"{"command":"seek","time_s":"x"}"#, "{", ""] {
        let (code, answer) = ask(port, post, &[JSON, BEARER], body);
        assert!(code == 422 && answer.contains("no order to a recorded flight"), "{body}: {answer}");
    }
    let pause = r#"{"command":"pause"}"#;
    assert_eq!(ask(port, post, &[JSON], pause).0, 401, "without the token");
    assert_eq!(ask(port, post, &[JSON, BEARER, "Origin: https://evil.example"], pause).0, 403);
    assert_eq!(ask(port, post, &["Content-Type: text/plain", BEARER], pause).0, 415);
    let spoken = ("sec-websocket-protocol", "foxglove.sdk.v1");
    assert_eq!(refused(port, FOXGLOVE, &[spoken]), 404);
    assert_eq!(replay.interrupt().0, Some(0));

    let (ns, port) = (namespace(), free_port());
    let server = Server::start(&ns, port);
    let (code, answer) = ask(port, post, &[JSON, BEARER], pause);
    assert!(code == 422 && answer.contains("no order to a flight under way") && answer.contains("inject"), "{answer}");
    drop(server);
}

#[test]
fn a_torn_log_plays_as_far_as_it_reads_and_a_part_as_far_as_it_goes() {
    let flown = eventful();
    let part = Replay::start(&flown.out, &["--from", "4s", "--to", "5s"]);
    let mut socket = part.page();
    let told = frame(&mut socket, is("flight"));
    assert_eq!((&told["begin_s"], &told["end_s"]), (&json!(4.0), &json!(5.0)), "{told}");
    let status = frame(&mut socket, |frame| frame["kind"] == "status" && frame["nodes"][3].is_object());
    let [epoch, restarts] = ["epoch", "restarts"].map(|key| status["nodes"][3][key].as_u64());
    assert_eq!((epoch, restarts), (Some(2), Some(1)), "what happened before is known: {status}");
    part.interrupt();

    let log = flown.out.join("flight.mcap");
    let bytes = std::fs::read(&log).expect("a log");
    std::fs::write(&log, &bytes[..bytes.len() / 2]).expect("written");
    let torn = Replay::start(&flown.out, &[]);
    let mut socket = torn.page();
    let told = frame(&mut socket, is("flight"));
    assert!((3.0..9.0).contains(&told["end_s"].as_f64().expect("a time")), "{told}");
    let (code, told) = torn.interrupt();
    assert!(code == Some(1) && told.contains("is not whole"), "{code:?}: {told}");
}

#[test]
fn a_recorded_flight_plays_in_a_browser_narrow_and_wide_light_and_dark_and_by_keyboard() {
    let Some(scripts) = pages::browser() else { return };
    let flown = eventful();
    let replay = Replay::start(&flown.out, &[]);
    drop(replay.page());
    let url = format!("http://127.0.0.1:{}/?token={TOKEN}", replay.port);
    let output = Command::new("node").arg(scripts.join("replay.mjs")).arg(&url).output().expect("node starts");
    let [told, failed] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    assert!(output.status.success(), "{told}{failed}");
    assert_eq!(replay.interrupt().0, Some(0));
}

/// Settings of a campaign whose flights fail half the time.
const CAMPAIGN: &str = "[settings]\nrun.duration_s = 3.0\nbounds.max_position_error_m = 0.03\n[vary]\n\
                        plant.airframe.mass_kg = { uniform = [0.9, 1.4] }\nrun.command_delay_ms = { uniform = [0.0, 30.0] }\n\
                        [controller.mpc]\nattitude.law = \"mpc\"\n[controller.pid]\nattitude.law = \"pid\"\n";

/// Returns the command `trefoil campaign` with `samples` samples, results in `out`, and `more` arguments.
fn campaign(folder: &Path, out: &str, samples: u32, more: &[&str]) -> Command {
    let file = folder.join("shown.toml");
    std::fs::write(&file, format!("samples = {samples}\n{CAMPAIGN}")).expect("written");
    let mut command = launcher();
    command.arg("campaign").arg(&file).arg("--out").arg(folder.join(out)).args(more);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Number of flights of a campaign whose page is seen from its beginning to its end.
const FLIGHTS: u64 = 1200;

/// Returns the number of flights in the title of a campaign's page.
fn counted(page: &str) -> u64 {
    let title = page
        .split_once("<title>Campaign shown, ")
        .and_then(|(_, rest)| rest.split_once(&format!(" of {FLIGHTS} flights<")));
    title.and_then(|(count, _)| count.parse().ok()).unwrap_or_else(|| panic!("no title: {}", &page[..300]))
}

#[test]
fn a_campaign_fills_its_page_while_it_flies_and_flies_the_same_bits() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let port = free_port();
    let address = format!("127.0.0.1:{port}");
    let child =
        campaign(folder.path(), "shown", FLIGHTS as u32 / 2, &["--shard", "40", "--web", &address, "--token", TOKEN])
            .spawn();
    let child = child.expect("it starts");
    wait_until("the port is open", || TcpStream::connect(("127.0.0.1", port)).is_ok());
    assert_eq!(ask(port, "GET /", &[], "").0, 401);
    assert_eq!(ask(port, "GET /", &[BEARER, "Origin: https://evil.example"], "").0, 403);
    let (code, first) = ask(port, "GET /", &[BEARER], "");
    assert!(code == 200 && first.contains("script-src 'nonce-") && first.contains("<progress"), "{code}");
    let stop = ask(port, "POST /command", &[JSON, BEARER], "{}");
    assert!(stop.0 == 404 && stop.1.contains("a campaign takes no orders"), "{stop:?}");
    let spoken = ("sec-websocket-protocol", "foxglove.sdk.v1");
    assert_eq!(refused(port, FOXGLOVE, &[spoken]), 404);
    let mut socket = open(port, PAGE, &[]).expect("the token opens it");
    let mut counts = vec![counted(&first)];
    let mut last = first;
    while frame(&mut socket, is("phase"))["phase"] == "changed" {
        last = ask(port, "GET /", &[BEARER], "").1;
        counts.push(counted(&last));
    }
    assert!(counts.is_sorted() && counts[0] < FLIGHTS && counts.last() == Some(&FLIGHTS), "{counts:?}");
    for part in [
        "Flights so far",
        "no random sample",
        "no more flights are flown",
        "The worst flights so far",
        "plant.airframe.mass_kg",
    ] {
        assert!(last.contains(part), "{part}: {last}");
    }
    let output = child.wait_with_output().expect("it ends");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && told.contains("page of the campaign: http://127.0.0.1"), "{told}");
    let plain = campaign(folder.path(), "plain", FLIGHTS as u32 / 2, &["--shard", "40"]).output().expect("it runs");
    assert!(plain.status.success());
    let table = |out: &str| std::fs::read(folder.path().join(out).join("flights.parquet")).expect("a table");
    assert!(table("shown") == table("plain"), "a page changes no result");
}

#[test]
fn the_page_of_a_campaign_keeps_its_place_in_a_browser() {
    let Some(scripts) = pages::browser() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let port = free_port();
    let address = format!("127.0.0.1:{port}");
    let child =
        campaign(folder.path(), "shown", 200_000, &["--web", &address, "--token", TOKEN]).spawn().expect("it starts");
    wait_until("the port is open", || TcpStream::connect(("127.0.0.1", port)).is_ok());
    let url = format!("http://{address}/?token={TOKEN}");
    let output = Command::new("node").arg(scripts.join("campaign.mjs")).arg(&url).output().expect("node starts");
    kill_process(Pid::from_child(&child), Signal::INT).expect("it flies");
    assert_eq!(child.wait_with_output().expect("it ends").status.code(), Some(130));
    let [told, failed] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    assert!(output.status.success(), "{told}{failed}");
}

#[test]
fn a_page_that_cannot_be_is_refused_before_the_flight() {
    let said = |arguments: &[&str]| {
        let output = launcher().args(arguments).output().expect("it runs");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = taken.local_addr().expect("an address").to_string();
    for (arguments, expected) in [
        (&["fly", "--mode", "inprocess", "--web"][..], "a flight in process is over"),
        (&["fly", "--token", TOKEN], "there is none"),
        (&["fly", "--web", "--token"], "a value is required"),
        (&["fly", "--web", &address], "give another address"),
        (&["fly", "--web", "scenarios/survey.toml"], "a scenario before --web"),
        (&["fly", "--web", "--token", "short"], "a token has 16"),
        (&["web", &address], "give another address"),
        (&["web", "--namespace", "no/name"], "no/name"),
        (&["serve-page"], "for `trefoil fly --web`"),
        (&["campaign", "fifty-seeds", "--web", &address], "give another address"),
        (&["campaign", "fifty-seeds", "--token", TOKEN], "there is none"),
        (&["campaign", "fifty-seeds", "--slurm", "--web"], "on this machine"),
        (&["campaign", "fifty-seeds", "--plan", "--web"], "on this machine"),
        (&["replay", "runs/none", "--web", &address], "give another address"),
        (&["replay", "runs/none", "--token", TOKEN], "there is none"),
        (&["replay", "runs/none", "--web", "127.0.0.1:0"], "is not there"),
        (&["replay", "runs/none", "--web", "--node", "mixer", "--exec", "x"], "--web goes without --exec"),
    ] {
        let (code, text) = said(arguments);
        assert!(code == Some(2) && text.contains(expected), "{arguments:?}: {code:?} {text}");
    }
}

#[test]
fn the_page_works_in_a_browser_narrow_and_wide_light_and_dark_and_by_keyboard() {
    let Some(scripts) = pages::browser() else { return };
    let (ns, port) = (namespace(), free_port());
    let settings = ["--set", "run.duration_s=3600.0", "--set", "mission.trajectory=hover", "--set", DRAG];
    let flight = with_page(&ns, port, &settings);
    let url = format!("http://127.0.0.1:{port}/?token={TOKEN}");
    let output = Command::new("node").arg(scripts.join("live.mjs")).arg(&url).output().expect("node starts");
    let [told, failed] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    assert!(output.status.success(), "{told}{failed}");
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(130), "stopped by the page: {}", outcome.stderr);
}
