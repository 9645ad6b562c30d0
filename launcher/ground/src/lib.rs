//! Shows a flight to ground stations: MAVLink 2 over UDP, from a process that observes the flight.
//!
//! ```text
//! ring, launcher -- Observer --> Vehicle --- streams, events --->  Link  --- UDP ---> ground station
//!                                answers <-- requests ------------       <-----------
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`address`] | address of the ground station, such as `udpout:127.0.0.1:14550` |
//! | `link` | MAVLink frames in datagrams |
//! | `vehicle` | the newest messages of the flight, and the MAVLink messages made of them |
//! | [`home`] | the place on the earth that the flight's origin stands for |
//! | `streams` | the rates at which messages are sent |
//! | `parameters` | the settings of the flight as read-only parameters |
//! | `answers` | answers to requests; none of them changes the flight |
//!
//! `docs/mavlink.md` has the table of messages with their sources.

pub mod address;
mod answers;
pub mod home;
mod link;
mod parameters;
mod streams;
mod vehicle;

use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::sleep;
use std::time::Instant;

use anyhow::bail;
use flight::observer::{Look, OBSERVER_POLL, Observer, Seen};

pub use address::Address;
pub use home::Home;

use answers::Station;
use link::StationLink;
use parameters::MavlinkParameters;
use streams::Streams;
use vehicle::MavlinkVehicle;

/// Largest number of datagrams that are read after one look at the flight; further ones wait in the socket's buffer,
/// and the kernel drops them when it is full.
const DATAGRAMS: usize = 32;
/// Number of answers after one look from which on no more datagrams are read: about two lists of all parameters.
const ANSWERS: usize = 130;

/// Shows the flight of `namespace` to the ground station at `address`, until the flight ends or an interrupt comes.
/// Calls `joined` as soon as no message can be missed.
///
/// # Errors
/// The address cannot be used, there is no flight to observe, or its launcher was killed.
pub fn show(
    namespace: &str,
    address: &Address,
    home: Home,
    interrupts: &AtomicU32,
    joined: impl FnOnce(),
) -> anyhow::Result<()> {
    let mut link = StationLink::open(address)?;
    let mut observer = Observer::join(namespace)?;
    joined();
    let scenario = observer.scenario().clone();
    let mut station = Station {
        vehicle: MavlinkVehicle::new(&scenario, home),
        parameters: MavlinkParameters::of(&scenario),
        streams: Streams::new(Instant::now()),
    };
    loop {
        let look = observer.look(|seen| match seen {
            Seen::Message(record) => station.vehicle.observe(record),
            Seen::Event(event) => vehicle::status_texts(event).iter().for_each(|text| link.send(text)),
        });
        answer(&mut link, &mut station);
        for id in station.streams.due(Instant::now()) {
            if let Some(message) = station.vehicle.message(id) {
                link.send(&message);
            }
        }
        match look {
            _ if interrupts.load(Ordering::Relaxed) > 0 => return Ok(()),
            Look::Flying(0) => sleep(OBSERVER_POLL),
            Look::Flying(_) => {} // more messages may have arrived meanwhile
            Look::Ended => {
                link.send(&station.vehicle.last_heartbeat());
                return Ok(());
            }
            Look::Lost => bail!("the flight's launcher was killed"),
        }
    }
}

/// Answers the datagrams that have arrived, within the limits of one look: a flood must neither hide the end of the
/// flight nor take the processor from the ring.
fn answer(link: &mut StationLink, station: &mut Station) {
    let mut answered = 0;
    for _ in 0..DATAGRAMS {
        let Ok(datagram) = link.receive() else { return };
        let answers = datagram.map_or(vec![], |(from, request)| station.answer(from, &request));
        for answer in &answers {
            link.send(answer);
        }
        answered += answers.len();
        if answered >= ANSWERS {
            return;
        }
    }
}
