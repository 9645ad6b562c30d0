//! MAVLink 2 frames in UDP datagrams, one frame each. Nothing here waits: a frame that cannot be sent at once is lost.

use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

use anyhow::Context;
use mavlink::dialects::common::MavMessage;
use mavlink::{MavHeader, MavlinkReader, write_v2_msg};

use crate::address::{Address, Way};

/// Number of the vehicle in a MAVLink network.
pub const SYSTEM: u8 = 1;
/// Component of the vehicle that sends: `MAV_COMP_ID_AUTOPILOT1`.
pub const COMPONENT: u8 = 1;

/// Link to one ground station.
pub struct StationLink {
    socket: UdpSocket,
    /// Address of the station; `None` until a station has sent a message.
    peer: Option<SocketAddr>,
    way: Way,
    sequence: u8,
}

impl StationLink {
    /// Opens the socket; sends nothing yet.
    pub fn open(address: &Address) -> anyhow::Result<Self> {
        let any: IpAddr = match address.at {
            SocketAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
            SocketAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
        };
        let own = if address.way == Way::Out { SocketAddr::new(any, 0) } else { address.at };
        let socket = UdpSocket::bind(own).with_context(|| format!("cannot open a UDP socket at {own}"))?;
        socket.set_nonblocking(true)?;
        if address.way == Way::Out {
            // A connected socket receives datagrams from this address only.
            socket.connect(address.at).with_context(|| format!("cannot send to {}", address.at))?;
        }
        let peer = (address.way == Way::Out).then_some(address.at);
        Ok(Self { socket, peer, way: address.way, sequence: 0 })
    }

    /// Sends a message, if there is a station.
    pub fn send(&mut self, message: &MavMessage) {
        let Some(peer) = self.peer else { return };
        let header = MavHeader { system_id: SYSTEM.into(), component_id: COMPONENT, sequence: self.sequence };
        self.sequence = self.sequence.wrapping_add(1);
        let mut frame = vec![];
        if write_v2_msg(&mut frame, header, message).is_ok() {
            // Fails while no station listens, or if the network is full: the next message may arrive.
            let _ = match self.way {
                Way::Out => self.socket.send(&frame),
                Way::In => self.socket.send_to(&frame, peer),
            };
        }
    }

    /// Reads the next datagram; returns its message and sender, `None` if it is no MAVLink.
    ///
    /// # Errors
    /// No datagram has arrived.
    pub fn receive(&mut self) -> io::Result<Option<(MavHeader, MavMessage)>> {
        let mut bytes = [0; 2048];
        let (length, from) = match self.socket.recv_from(&mut bytes) {
            // A host where no station listens has refused the last frame.
            Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => return Ok(None),
            received => received?,
        };
        let message = MavlinkReader::new(&bytes[..length]).read_any_message::<MavMessage>().ok();
        if message.is_some() {
            self.peer = Some(from);
        }
        Ok(message)
    }
}
