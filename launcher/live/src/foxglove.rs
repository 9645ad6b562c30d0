//! Foxglove's websocket protocol: Foxglove and Lichtblick show the flight while it flies.
//!
//! ```text
//! server: serverInfo, advertise                       JSON, once
//! client: subscribe, unsubscribe                      JSON
//! server: 1, subscription (u32), log time (u64), bytes of the message    binary, little-endian
//! ```
//!
//! Channels, schemas and bytes are the same as in `export --to foxglove`: first the channels of the log
//! ([`flight::log::channels`]), then the channels of [`view::scene`], whose messages a [`Scene`] makes. A message that
//! holds for the whole flight is sent to each client that subscribes to its channel. The server has no other
//! capability: it takes no parameters, no service calls and no messages of clients. The protocol is the same under both
//! of its names.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::extract::ws::{Message, WebSocket};
use axum::http::{HeaderMap, header};
use base64::prelude::{BASE64_STANDARD, Engine};
use flight::event::Event;
use flight::log::{self, Channel, Record};
use serde::Deserialize;
use serde_json::{Value, json};
use settings::Scenario;
use tokio::sync::broadcast::error::RecvError;
use view::scene::{DerivedMessage, Scene};

use crate::hub::{Hub, Published};
use crate::socket::send;

/// Names of the protocol, the newer one first.
pub const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// Opcode of a message of a channel.
const MESSAGE_DATA: u8 = 1;
/// Largest number of subscriptions of a client.
const SUBSCRIPTIONS: usize = 256;

/// Encodes a flight for the clients, message by message.
pub struct Encoder {
    scene: Scene,
    sample_ns: u64,
    /// Number of channels before the channels of [`view::scene`].
    before_view: usize,
}

impl Encoder {
    /// Begins a flight of `scenario`, and publishes the messages that hold for the whole flight.
    pub fn begin(scenario: &Scenario, hub: &Hub) -> Self {
        let (scene, before_view) = (Scene::new(scenario), log::channels().len());
        let fixed = scene.fixed();
        let encoder = Self { scene, sample_ns: scenario.sample_ns(), before_view };
        hub.send_fixed(fixed.into_iter().map(|derived| encoder.published(derived)).collect());
        encoder
    }

    /// Publishes a message of the ring if there are clients. Without clients the scene still follows the flight,
    /// because it draws the path flown.
    pub fn on_record(&mut self, record: &Record, hub: &Hub) {
        let derived = self.scene.on_record(record);
        if hub.has_listeners() {
            hub.publish(self.of_log(record.kind(), record.tick(), log::encode(record)));
            for derived in derived {
                hub.publish(self.published(derived));
            }
        }
    }

    /// Publishes an event.
    pub fn on_event(&mut self, event: &Event, hub: &Hub) {
        hub.publish(self.of_log(Record::KINDS, event.tick, log::encode_event(event)));
        let derived = self.scene.on_event(event);
        hub.publish(self.published(derived));
    }

    /// Makes the message of `tick` on a channel of the log.
    fn of_log(&self, channel: usize, tick: u64, bytes: Vec<u8>) -> Published {
        Published { channel, log_time_ns: tick.saturating_mul(self.sample_ns), bytes: bytes.into() }
    }

    fn published(&self, derived: DerivedMessage) -> Published {
        let DerivedMessage { channel, time_ns, bytes } = derived;
        Published { channel: self.before_view + channel as usize, log_time_ns: time_ns, bytes: bytes.into() }
    }
}

/// Lists the channels; a channel's number is its index.
fn channels() -> Vec<Channel> {
    [log::channels(), view::scene::SceneChannel::of_log().into()].concat()
}

/// Request of a client. Any other request is answered with a warning.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum Asked {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
}

#[derive(Debug, PartialEq, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    channel_id: usize,
}

/// Channels that a client has subscribed to, by the client's number of the subscription.
#[derive(Default)]
struct Subscriptions(BTreeMap<u32, usize>);

impl Subscriptions {
    /// Carries out a request. Returns the answers: the messages that hold for the whole flight on the channel of each
    /// new subscription, which `fixed` finds, and a warning if the request is invalid.
    fn take(&mut self, text: &str, channels: usize, fixed: impl Fn(usize) -> Vec<Published>) -> Vec<Message> {
        let status = |words: &str| Message::Text(warning(words).to_string().into());
        let mut answers = vec![];
        match serde_json::from_str(text) {
            Ok(Asked::Subscribe { subscriptions }) => {
                for Subscription { id, channel_id } in subscriptions {
                    if channel_id >= channels || self.0.len() >= SUBSCRIPTIONS {
                        answers.push(status(&format!("channel {channel_id} cannot be subscribed to")));
                        break;
                    }
                    self.0.insert(id, channel_id);
                    let kept = fixed(channel_id);
                    answers.extend(kept.iter().map(|message| Message::Binary(data(id, message).into())));
                }
            }
            Ok(Asked::Unsubscribe { subscription_ids }) => {
                for id in &subscription_ids {
                    self.0.remove(id);
                }
            }
            Err(error) => answers.push(status(&format!("not understood: {error}"))),
        }
        answers
    }

    /// Makes a frame of the message for each subscription to its channel.
    fn frames(&self, message: &Published) -> Vec<Vec<u8>> {
        let ids = self.0.iter().filter(|(_, channel)| **channel == message.channel);
        ids.map(|(id, _)| data(*id, message)).collect()
    }
}

/// Returns whether a client offers a name of the protocol.
pub fn is_spoken(headers: &HeaderMap) -> bool {
    let offered = headers.get_all(header::SEC_WEBSOCKET_PROTOCOL).iter().filter_map(|value| value.to_str().ok());
    offered.flat_map(|list| list.split(',')).any(|name| PROTOCOLS.contains(&name.trim()))
}

/// Serves one client until it leaves, or does not read.
pub async fn serve(mut socket: WebSocket, hub: Arc<Hub>) {
    let mut messages = hub.messages.subscribe();
    let count = channels().len();
    for greeting in [server_info(hub.namespace().as_deref()), advertise()] {
        if !send(&mut socket, Message::Text(greeting.to_string().into())).await {
            return;
        }
    }
    let mut subscriptions = Subscriptions::default();
    loop {
        let frames: Vec<Message> = tokio::select! {
            message = messages.recv() => match message {
                Ok(message) => subscriptions.frames(&message).into_iter().map(|frame| Message::Binary(frame.into())).collect(),
                Err(RecvError::Lagged(_)) => continue, // the oldest messages are lost
                Err(RecvError::Closed) => break,
            },
            received = socket.recv() => match received {
                Some(Ok(Message::Text(text))) => subscriptions.take(&text, count, |channel| hub.fixed(channel)),
                Some(Ok(Message::Close(_)) | Err(_)) | None => break,
                Some(Ok(_)) => continue, // other messages are ignored
            },
        };
        for frame in frames {
            if !send(&mut socket, frame).await {
                return;
            }
        }
    }
}

fn server_info(namespace: Option<&str>) -> Value {
    json!({
        "op": "serverInfo",
        "name": namespace.map_or("Trefoil".into(), |namespace| format!("Trefoil, namespace {namespace}")),
        "capabilities": [],
        "supportedEncodings": ["protobuf"],
        "metadata": {},
    })
}

fn advertise() -> Value {
    let all = channels();
    let channel = |(id, channel): (usize, &Channel)| {
        json!({
            "id": id,
            "topic": channel.topic,
            "encoding": "protobuf",
            "schemaName": channel.schema,
            "schema": BASE64_STANDARD.encode(channel.descriptors),
            "schemaEncoding": "protobuf",
        })
    };
    json!({ "op": "advertise", "channels": all.iter().enumerate().map(channel).collect::<Vec<_>>() })
}

fn warning(words: &str) -> Value {
    json!({ "op": "status", "level": 1, "message": words })
}

/// Makes the frame of a message for the subscription `id`.
fn data(id: u32, message: &Published) -> Vec<u8> {
    let header = [&[MESSAGE_DATA][..], &id.to_le_bytes(), &message.log_time_ns.to_le_bytes()].concat();
    [&header, message.bytes.as_ref()].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_has_13_bytes_before_the_message() {
        let message = Published { channel: 1, log_time_ns: 0x0102, bytes: vec![7, 8].into() };
        assert_eq!(data(3, &message), [1, 3, 0, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 7, 8]);
    }

    #[test]
    fn a_client_gets_what_it_has_subscribed_to() {
        let mut all = Subscriptions::default();
        let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":0,"channelId":1},{"id":9,"channelId":1}]}"#;
        let message = |channel| Published { channel, log_time_ns: 0, bytes: vec![].into() };
        let answers = all.take(subscribe, 6, |channel| vec![message(channel)]);
        let kept = [0, 9].map(|id| Message::Binary(data(id, &message(1)).into()));
        assert_eq!(answers, kept, "what holds for the whole flight comes with the subscription");
        assert_eq!((all.frames(&message(1)).len(), all.frames(&message(2)).len()), (2, 0));
        let none = |_| vec![];
        assert_eq!(all.take(r#"{"op":"unsubscribe","subscriptionIds":[0]}"#, 6, none), []);
        assert_eq!(all.frames(&message(1))[0][1], 9);
        for (text, expected) in [
            (r#"{"op":"subscribe","subscriptions":[{"id":1,"channelId":6}]}"#, "channel 6"),
            (r#"{"op":"setParameters"}"#, "not understood"),
            ("{", "not understood"),
        ] {
            let answers = all.take(text, 6, none);
            assert!(matches!(&answers[..], [Message::Text(status)] if status.contains(expected)), "{answers:?}");
        }
    }

    #[test]
    fn every_channel_of_the_log_is_advertised_with_its_schema() {
        let greeting = advertise();
        let channels = greeting["channels"].as_array().unwrap();
        assert!(channels.len() >= 6);
        assert_eq!((&channels[0]["topic"], &channels[0]["schemaName"]), (&json!("/state"), &json!("trefoil.v1.State")));
        let schema = |channel: &Value| BASE64_STANDARD.decode(channel["schema"].as_str().unwrap()).unwrap();
        assert!(schema(&channels[4]).windows(12).any(|window| window == b"trefoil.prot"), "a set of descriptors");
        let vehicle = channels.iter().find(|channel| channel["topic"] == "/view/vehicle").expect("the vehicle");
        assert_eq!(vehicle["schemaName"], "foxglove.SceneUpdate");
        assert_eq!(schema(vehicle), view::scene::DESCRIPTORS);
    }

    #[test]
    fn both_names_of_the_protocol_are_spoken() {
        for (offered, expected) in
            [("foxglove.sdk.v1", true), ("x, foxglove.websocket.v1", true), ("foxglove", false), ("", false)]
        {
            let headers = HeaderMap::from_iter([(header::SEC_WEBSOCKET_PROTOCOL, offered.parse().unwrap())]);
            assert_eq!(is_spoken(&headers), expected, "{offered}");
        }
    }
}
