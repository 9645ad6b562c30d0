//! The intruder: a process that does not belong to the run and tries to get in. A `[[fault]]` of a topic starts it.
//!
//! ```text
//! second-publisher   opens the topic and answers every message that it receives with two forgeries: newer, all zero,
//!                    with a valid checksum; one has the epoch of the message, the other the next epoch
//! wrong-layout       opens the topic with another layout of its messages
//! wrong-user         becomes the user `nobody`, tries to join as a node does, and then to open the run's files
//! ```
//!
//! The last line on stdout is its result. The launcher starts the intruder and records that line as an event.

use std::fs::File;
use std::path::PathBuf;

use anyhow::{Context, bail};
use contract::Topic;
use contract::exit;
use contract::message::{Actuators, Controls, Reference, Stamp, State};
use contract::scenario::FaultKind;
use runtime::domain::Domain;
use runtime::port::{Bus, NODE_DEPTH, Wire};
use runtime::realtime::{ControlPage, now_ns, phase};
use runtime::session::NodeSession;
use rustix::process::{Gid, Signal, Uid};

use runtime::console::print;

/// Beginning of the last line if the intruder was refused.
pub const REFUSED: &str = "refused: ";
/// Beginning of the last line if it was let in.
pub const LET_IN: &str = "let in: ";
/// Beginning of the last line if it has sent messages.
pub const SENT: &str = "sent ";
const NOBODY: u32 = 65534;
const LOOK_NS: u64 = 20_000_000;

#[derive(clap::Args)]
pub struct IntrudeArgs {
    /// Namespace of the stack
    #[arg(long)]
    namespace: String,
    /// Topic to intrude on
    #[arg(long)]
    topic: String,
    /// second-publisher, wrong-layout or wrong-user
    #[arg(long)]
    kind: String,
    /// Tick at which to leave
    #[arg(long)]
    until: u64,
}

/// Makes the attempt, and prints its result.
pub fn intrude(args: &IntrudeArgs) -> anyhow::Result<u8> {
    // Fails only for a signal number that does not exist.
    let _ = rustix::process::set_parent_process_death_signal(Some(Signal::KILL));
    let topic = Topic::ALL.into_iter().find(|topic| topic.name() == args.topic).context("no such topic")?;
    let how = match topic {
        Topic::State => on::<State>(args),
        Topic::Reference => on::<Reference>(args),
        Topic::Controls => on::<Controls>(args),
        Topic::Actuators => on::<Actuators>(args),
    }?;
    print(&(how + "\n"));
    Ok(exit::FLOWN)
}

fn on<M: Wire>(args: &IntrudeArgs) -> anyhow::Result<String> {
    let kind: FaultKind = serde_json::from_value(args.kind.clone().into())?;
    match kind {
        FaultKind::SecondPublisher => send::<M>(&args.namespace, args.until),
        FaultKind::WrongLayout => {
            let bus = Bus::attach(&Domain::find(&args.namespace)?)?;
            Ok(match bus.open_as_another_version::<M>() {
                Err(why) => format!("{REFUSED}{why}"),
                Ok(()) => format!("{LET_IN}it opened the topic"),
            })
        }
        FaultKind::WrongUser => {
            let domain = Domain::find(&args.namespace)?;
            become_nobody()?;
            Ok(try_to_enter(&domain))
        }
        _ => bail!("an intruder does not do that"),
    }
}

/// Sends forged messages until tick `until` or the end of the run.
fn send<M: Wire>(namespace: &str, until: u64) -> anyhow::Result<String> {
    let domain = Domain::find(namespace)?;
    let page = ControlPage::open(&domain.file("page"))?;
    let bus = Bus::attach(&domain)?;
    let (port, receiver) = (bus.sender::<M>()?, bus.receiver::<M>(NODE_DEPTH)?);
    print("ready\n");
    let doorbell = page.doorbell(M::TOPIC);
    let mut sent = 0;
    while page.plant_tick() < until && page.phase.count() < phase::LEAVE {
        let rung = doorbell.count(); // counted before the look, so that a message that comes after it ends the wait
        let mut answer = |message: &M, from| {
            if from != port.number() {
                let epoch = message.stamp().epoch;
                let forgeries = [epoch, epoch + 1].map(|epoch| port.send(&forge(message, epoch)).is_ok());
                sent += forgeries.iter().filter(|sent| **sent).count();
                doorbell.ring();
            }
        };
        while receiver.receive(&mut answer) == Ok(true) {}
        doorbell.wait(rung, now_ns() + LOOK_NS);
    }
    Ok(format!("{SENT}{sent} messages"))
}

/// Returns a message of which only the sender is wrong: newer than `message`, with a valid checksum, and all zero.
fn forge<M: Wire>(message: &M, epoch: u64) -> M {
    let mut forged = M::default();
    let Stamp { tick, sequence, .. } = *message.stamp();
    *forged.stamp_mut() = Stamp { tick: tick + 1, sequence: sequence + 1, epoch, ..*message.stamp() };
    forged.with_checksum()
}

fn become_nobody() -> anyhow::Result<()> {
    let (uid, gid) = (Uid::from_raw(NOBODY), Gid::from_raw(NOBODY));
    rustix::thread::set_thread_groups(&[])
        .and_then(|()| rustix::thread::set_thread_res_gid(gid, gid, gid))
        .and_then(|()| rustix::thread::set_thread_res_uid(uid, uid, uid))
        .context("cannot become another user; only root can")
}

/// Tries to join as a node does, and then to open the files of the run; returns the result.
fn try_to_enter(domain: &Domain) -> String {
    let Err(refusal) = NodeSession::join(domain.namespace(), Topic::Actuators.publisher(), 1, None) else {
        return format!("{LET_IN}it joined");
    };
    let inside = ["scenario.toml", "page", "iox"].map(|name| domain.file(name));
    let files = domain.folder.ancestors().take(2).map(PathBuf::from).chain(inside);
    match files.into_iter().find(|file: &PathBuf| File::open(file).is_ok()) {
        Some(file) => format!("{LET_IN}it opened {}", file.display()),
        None => format!("{REFUSED}{refusal}"),
    }
}
