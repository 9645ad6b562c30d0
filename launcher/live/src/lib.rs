//! Shows a flight, under way or recorded: a page in the browser, and Foxglove's protocol, by a process that only reads.
//!
//! ```text
//! ring ----> Observer (a thread) --> Hub: newest of everything, a bounded queue per client
//! log -----> Player (a thread) ----> |--> /ws        the page, as JSON
//!                                    |--> /foxglove  the channels of the log, message by message; live flights only
//! browser -> /command --> trefoil inject | clear | swap | stop, as a process; or play, pause, seek, speed
//! ```
//!
//! The ring never waits for this process ([`flight::observer`]), and this process never waits for a browser: each has
//! a queue of a fixed length, which loses its oldest entries.
//!
//! | module | holds |
//! |---|---|
//! | [`access`] | rules for connections: token, host, origin |
//! | `server` | the requests of HTTP, and the websocket of the page |
//! | `hub` | frames on their way from the flight to the clients |
//! | `watch` | the thread that observes the flights of a namespace, one after the other |
//! | [`document`] | a page that is made anew while it is served |
//! | [`player`] | the thread that plays a recorded flight |
//! | `nodes` | the active processes of a recorded flight, from its messages and events |
//! | `frames` | frames of the page, and their sources |
//! | `foxglove` | Foxglove's websocket protocol |
//! | `orders` | the buttons of the page as command lines |
//! | `page` | the page's HTML |
//! | `socket` | sending to a client that may not read |

#![allow(missing_docs)]

pub mod access;
pub mod document;
mod foxglove;
mod frames;
mod hub;
mod nodes;
mod orders;
mod page;
pub mod player;
mod server;
mod socket;
mod watch;

use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use std::thread::JoinHandle;

use access::Access;
use document::Document;
use hub::Hub;
use player::Player;
use server::ServerContent;
use watch::Watch;

/// Flights that a server shows.
pub enum FlightSource {
    /// Flights under way.
    Flights {
        /// Namespace of the flights; `None`: the only flight that there is.
        namespace: Option<String>,
        /// `true` if the server ends with the first flight; otherwise it waits for the next one.
        one_flight: bool,
    },
    /// Recorded flight, shown until an interrupt.
    Recorded(Arc<Player>),
}

/// Serves what `source` shows on `listener` to the clients that `access` lets in, until an interrupt, or the end of the
/// only flight.
pub fn serve(
    listener: TcpListener,
    access: Access,
    source: FlightSource,
    interrupts: Arc<AtomicU32>,
) -> anyhow::Result<()> {
    listener.set_nonblocking(true)?;
    let hub = Arc::new(Hub::new());
    let (thread, content) = match source {
        FlightSource::Flights { namespace, one_flight } => {
            let watch = Watch { namespace, one_flight, hub: hub.clone(), interrupts };
            (spawn("observer", move || watch.run())?, ServerContent::Live)
        }
        FlightSource::Recorded(player) => {
            let (plays, hub) = (player.clone(), hub.clone());
            (spawn("player", move || plays.run(&hub, &interrupts))?, ServerContent::Recorded(player))
        }
    };
    let served = run(listener, access, hub, content);
    let _ = thread.join(); // a panic has printed its reason
    served
}

/// Serves `document`, whose page may be replaced meanwhile, until it is closed.
pub fn serve_document(listener: TcpListener, access: Access, document: Arc<Document>) -> anyhow::Result<()> {
    listener.set_nonblocking(true)?;
    run(listener, access, document.hub.clone(), ServerContent::Document(document))
}

fn run(listener: TcpListener, access: Access, hub: Arc<Hub>, content: ServerContent) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let served = runtime.block_on(server::serve(listener, access, hub, content));
    // Threads that still carry out a command are not waited for.
    runtime.shutdown_background();
    served
}

fn spawn(name: &str, run: impl FnOnce() + Send + 'static) -> std::io::Result<JoinHandle<()>> {
    std::thread::Builder::new().name(name.into()).spawn(run)
}
