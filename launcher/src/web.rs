//! `web` and `fly --web`: the live page of a flight, by a process of its own. `replay --web` and `campaign --web`:
//! pages of a recorded flight and of a campaign under way, by the process of the command.
//!
//! `fly` opens the port, so that it can refuse to fly if the port is taken, and starts `trefoil serve-page` with the
//! port as its stdout. Namespace and token go through its stdin, because other users can read the arguments of a
//! process. When the launcher ends, stdin ends, and the process of the page ends too.

use std::io::Read;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::Thread;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use contract::exit;
use flight::interrupts::catch_interrupts;
use flight::own_program;
use live::FlightSource;
use live::access::Access;
use live::document::Document;
use live::player::Player;
use runtime::console::eprint_line;
use serde::{Deserialize, Serialize};

use crate::beside::{Beside, be_nice};

/// Port of an address that is given without a port.
const PORT: u16 = 8080;

/// Arguments of `web`.
#[derive(clap::Args)]
#[command(
    after_help = "The page also stands at /foxglove for Foxglove and Lichtblick (\"Open connection\", ws://ADDRESS/foxglove?token=TOKEN)."
)]
pub struct WebArgs {
    /// Address of the page: ADDRESS:PORT, ADDRESS or PORT
    #[arg(value_name = "ADDR", default_value = "127.0.0.1:8080", value_parser = address)]
    address: SocketAddr,
    /// Namespace of the stack; without it: the only one that flies
    #[arg(long)]
    namespace: Option<String>,
    #[command(flatten)]
    token: TokenArgs,
}

/// Argument that protects a page.
#[derive(clap::Args, Clone, Default)]
pub struct TokenArgs {
    /// Token that every request to the page must carry; other users can read it in /proc [default: a random token]
    #[arg(long, value_name = "TOKEN")]
    token: Option<String>,
}

/// Reads an address: `127.0.0.1:8080`, `localhost:8080`, `0.0.0.0`, `9000`.
pub fn address(text: &str) -> Result<SocketAddr, String> {
    let named = text.strip_prefix("localhost").map(|rest| format!("127.0.0.1{rest}"));
    let text = named.as_deref().unwrap_or(text);
    let of_port = || text.parse().ok().map(|port| SocketAddr::new(Ipv4Addr::LOCALHOST.into(), port));
    let of_ip = || text.parse().ok().map(|ip| SocketAddr::new(ip, PORT));
    let address = text.parse().ok().or_else(of_port).or_else(of_ip);
    address.ok_or_else(|| "no address; write 127.0.0.1:8080, 0.0.0.0:8080 or 8080, and a scenario before --web".into())
}

impl TokenArgs {
    /// Opens the port of a page at `address`.
    fn open(&self, address: SocketAddr) -> anyhow::Result<OpenPage> {
        let taken = || format!("cannot open {address} for the page; give another address, for example {}", PORT + 1);
        let listener = TcpListener::bind(address).with_context(taken)?;
        let access = Access::new(listener.local_addr()?, self.token.clone())?;
        Ok(OpenPage { listener, access })
    }
}

/// Serves the page of a flight that runs already, and of the flights that follow it, until Ctrl-C.
pub fn web(args: &WebArgs) -> anyhow::Result<u8> {
    if let Some(namespace) = &args.namespace {
        runtime::domain::check_name(namespace)?;
    }
    let page = args.token.open(args.address)?;
    eprint_line(&format!("live page: {}", page.access.url()));
    let interrupts = catch_interrupts()?;
    be_nice();
    let source = FlightSource::Flights { namespace: args.namespace.clone(), one_flight: false };
    live::serve(page.listener, page.access, source, interrupts)?;
    Ok(exit::FLOWN)
}

/// Port that is open for a page.
pub struct OpenPage {
    listener: TcpListener,
    access: Access,
}

/// Shortest time between two versions of a page; a version that took long is followed by a longer pause.
const VERSION_PERIOD: Duration = Duration::from_secs(2);
/// Shortest pause after a version, as a multiple of the time that it took to make the version.
const PAUSE_SHARE: u32 = 2;

/// Guard that tells the thread that makes a page, when the guard is dropped, that the task is over.
struct Over<'a> {
    is_over: &'a AtomicBool,
    maker: Thread,
}

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Release);
        self.maker.unpark();
    }
}

impl OpenPage {
    /// Serves the page that `render` makes while `task` runs: a first version at once, further versions at least two
    /// seconds apart by a thread of low priority, and a last version when the task has ended.
    pub fn while_running<T>(self, render: impl Fn() -> String + Sync, task: impl FnOnce() -> T) -> anyhow::Result<T> {
        let document = Arc::new(Document::new(render()));
        let is_over = AtomicBool::new(false);
        eprint_line(&format!("page of the campaign: {}", self.access.url()));
        std::thread::scope(|scope| {
            let spawn = |name: &str| std::thread::Builder::new().name(name.into());
            let (listener, access, served) = (self.listener, self.access, document.clone());
            spawn("page-server").spawn_scoped(scope, move || {
                be_nice();
                if let Err(error) = live::serve_document(listener, access, served) {
                    eprint_line(&format!("error: the page is no longer served: {error:#}"));
                }
            })?;
            let maker = spawn("page-maker").spawn_scoped(scope, || {
                be_nice();
                let mut pause = VERSION_PERIOD;
                loop {
                    std::thread::park_timeout(pause);
                    let (is_last, began) = (is_over.load(Ordering::Acquire), Instant::now());
                    document.replace(render());
                    if is_last {
                        break;
                    }
                    pause = VERSION_PERIOD.max(began.elapsed() * PAUSE_SHARE);
                }
                document.close();
            });
            let maker = maker.inspect_err(|_| document.close())?;
            let _over = Over { is_over: &is_over, maker: maker.thread().clone() }; // ends the page after a panic too
            Ok(task())
        })
    }

    /// Opens the port for a command that has a page if `web` is given.
    ///
    /// # Errors
    /// The port cannot be opened, or a token is given without a page.
    pub fn open(web: Option<SocketAddr>, token: &TokenArgs) -> anyhow::Result<Option<Self>> {
        ensure!(web.is_some() || token.token.is_none(), "--token protects the page of --web, and there is none");
        web.map(|address| token.open(address)).transpose()
    }

    /// Serves a recorded flight until Ctrl-C.
    pub fn play(self, player: Player) -> anyhow::Result<()> {
        let interrupts = catch_interrupts()?;
        eprint_line(&format!("page of the flight, until Ctrl-C: {}", self.access.url()));
        live::serve(self.listener, self.access, FlightSource::Recorded(Arc::new(player)), interrupts)
    }

    /// Starts the process that serves the page of the flight in `namespace`; the process waits for the flight.
    pub fn beside(self, namespace: &str) -> anyhow::Result<Beside> {
        let Self { listener, access } = self;
        eprint_line(&format!("live page: {}", access.url()));
        let mut command = own_program();
        command.arg("serve-page").stdin(Stdio::piped()).stdout(OwnedFd::from(listener));
        command.process_group(0); // Ctrl-C is for the launcher
        let mut beside = Beside::start("--web", &mut command)?;
        let task = Task { namespace: namespace.into(), token: access.token().into() };
        let stdin = beside.child.stdin.as_mut().context("the process of the page has no stdin")?;
        std::io::Write::write_all(stdin, (serde_json::to_string(&task)? + "\n").as_bytes())?;
        Ok(beside)
    }
}

/// Task of the process that serves the page of one flight.
#[derive(Serialize, Deserialize)]
struct Task {
    namespace: String,
    token: String,
}

/// Serves the page of one flight, as a process that `fly --web` has started.
pub fn serve_page() -> anyhow::Result<u8> {
    let listener = TcpListener::from(std::io::stdout().as_fd().try_clone_to_owned()?);
    let address = listener.local_addr().context("this command is for `trefoil fly --web`")?;
    let mut line = String::new();
    std::io::stdin().read_line(&mut line)?;
    ensure!(!line.is_empty(), "this command is for `trefoil fly --web`");
    let Task { namespace, token } = serde_json::from_str(&line)?;
    let interrupts = Arc::new(AtomicU32::new(0));
    let ends = interrupts.clone();
    std::thread::Builder::new().name("lifeline".into()).spawn(move || {
        let _ = std::io::stdin().read(&mut [0]); // returns when the launcher is gone
        ends.fetch_add(1, Ordering::Relaxed);
    })?;
    be_nice();
    let access = Access::new(address, Some(token))?;
    live::serve(listener, access, FlightSource::Flights { namespace: Some(namespace), one_flight: true }, interrupts)?;
    Ok(exit::FLOWN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_may_lack_host_or_port() {
        for (text, expected) in [
            ("127.0.0.1:9000", "127.0.0.1:9000"),
            ("9000", "127.0.0.1:9000"),
            ("0.0.0.0", "0.0.0.0:8080"),
            ("localhost:9000", "127.0.0.1:9000"),
            ("localhost", "127.0.0.1:8080"),
            ("[::1]:9000", "[::1]:9000"),
        ] {
            assert_eq!(address(text).map(|address| address.to_string()).as_deref(), Ok(expected), "{text}");
        }
        assert!(address("scenarios/survey.toml").unwrap_err().contains("a scenario before --web"));
    }
}
