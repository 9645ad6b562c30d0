//! Sending to a client that may not read.

use std::time::Duration;

use axum::extract::ws::{Message, WebSocket};
use tokio::time::timeout;

/// Longest time that a message may take on its way to a client; after that the client is disconnected.
const SEND_LIMIT: Duration = Duration::from_secs(20);

/// Sends one message; returns false if the client is gone, or does not read.
pub async fn send(socket: &mut WebSocket, message: Message) -> bool {
    matches!(timeout(SEND_LIMIT, socket.send(message)).await, Ok(Ok(())))
}
