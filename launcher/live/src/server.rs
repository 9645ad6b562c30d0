//! Requests of HTTP, and the websocket of the page.

use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Bytes;
use axum::extract::ws::{Message, Utf8Bytes, WebSocket};
use axum::extract::{DefaultBodyLimit, Request, State, WebSocketUpgrade};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri, header};
use axum::middleware::{self, Next};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{get, post};
use tokio::sync::broadcast::error::RecvError;

use crate::access::{self, Access, RequestRefused};
use crate::document::Document;
use crate::foxglove;
use crate::hub::Hub;
use crate::orders::{OrderAnswer, PageOrder};
use crate::page;
use crate::player::{PlayOrder, Player};
use crate::socket::send;

/// Path of Foxglove's websocket.
const FOXGLOVE: &str = "/foxglove";
/// Media type of an order and of its answer.
const JSON: &str = "application/json";
/// Longest request \[bytes\].
const BODY_BYTES: usize = 16 << 10;
/// Longest message and longest frame that a websocket's client may send \[bytes\].
const MESSAGE_BYTES: usize = 64 << 10;
/// Time between two checks whether the server must end.
const LOOK: Duration = Duration::from_millis(100);
/// Longest wait at the end for orders under way, and for a browser to fetch the last version of a page. `fly` kills
/// this process if its whole end takes five seconds.
const LAST_ANSWERS: Duration = Duration::from_secs(3);
/// Time for the last frames to reach the clients.
const LAST_FRAMES: Duration = Duration::from_millis(300);

/// Content of a server.
#[derive(Clone)]
pub enum ServerContent {
    /// Flights under way.
    Live,
    Recorded(Arc<Player>),
    Document(Arc<Document>),
}

#[derive(Clone)]
struct Context {
    access: Arc<Access>,
    hub: Arc<Hub>,
    content: ServerContent,
}

/// Serves until the hub is closed.
pub async fn serve(listener: TcpListener, access: Access, hub: Arc<Hub>, content: ServerContent) -> anyhow::Result<()> {
    let context = Context { access: Arc::new(access), hub: hub.clone(), content: content.clone() };
    let routes = Router::new()
        .route("/", get(whole_page))
        .route("/ws", get(follow))
        .route(FOXGLOVE, get(foxglove_socket))
        .route("/command", post(command))
        .layer(DefaultBodyLimit::max(BODY_BYTES))
        .layer(middleware::from_fn_with_state(context.clone(), check))
        .with_state(context);
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let closed = async move {
        while !hub.is_closed() {
            tokio::time::sleep(LOOK).await;
        }
        // The answer to `stop` comes after the flight has ended.
        let deadline = Instant::now() + LAST_ANSWERS;
        let is_unread = || matches!(&content, ServerContent::Document(document) if document.is_unread());
        while (hub.orders.load(Ordering::Relaxed) > 0 || is_unread()) && Instant::now() < deadline {
            tokio::time::sleep(LOOK).await;
        }
        tokio::time::sleep(LAST_FRAMES).await;
    };
    // A graceful shutdown would wait for every browser.
    tokio::select! {
        served = std::future::IntoFuture::into_future(axum::serve(listener, routes)) => served?,
        () = closed => {}
    }
    Ok(())
}

/// Passes on the requests that [`Access`] accepts, for any path, and adds headers for the browser to all answers.
async fn check(State(context): State<Context>, request: Request, next: Next) -> Response {
    let is_foxglove = request.uri().path() == FOXGLOVE;
    let mut response = match context.access.check(request.headers(), request.uri(), is_foxglove) {
        Ok(()) => next.run(request).await,
        Err(refused) => {
            let code = if refused == RequestRefused::Token { StatusCode::UNAUTHORIZED } else { StatusCode::FORBIDDEN };
            (code, refused.describe()).into_response()
        }
    };
    for (name, value) in [
        (header::CACHE_CONTROL, "no-store"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
    ] {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}

impl Context {
    /// Carries out an order to the flight under way.
    async fn carry_out(&self, order: PageOrder) -> OrderAnswer {
        let refused = |said: String| OrderAnswer { line: String::new(), ok: false, said };
        let Some(namespace) = self.hub.namespace() else { return refused("no stack is flying".into()) };
        self.hub.orders.fetch_add(1, Ordering::Relaxed);
        let done = tokio::task::spawn_blocking(move || order.run(&namespace)).await;
        self.hub.orders.fetch_sub(1, Ordering::Relaxed);
        done.unwrap_or_else(|error| refused(error.to_string()))
    }
}

/// Answers with the page; first moves the token from the address, where history and bookmarks keep it, into a cookie.
async fn whole_page(State(context): State<Context>, uri: Uri) -> Response {
    if access::token_in(&uri).is_some() {
        let kept = [(header::LOCATION, "/".to_owned()), (header::SET_COOKIE, context.access.cookie())];
        return (StatusCode::SEE_OTHER, kept).into_response();
    }
    let Ok(nonce) = access::random() else { return StatusCode::INTERNAL_SERVER_ERROR.into_response() };
    let html = match &context.content {
        ServerContent::Live => page::page(page::PageSubject::Live, &nonce),
        ServerContent::Recorded(_) => page::page(page::PageSubject::Recorded, &nonce),
        ServerContent::Document(document) => document.page(&nonce),
    };
    let mut response = Html(html).into_response();
    if let Ok(policy) = HeaderValue::from_str(&page::policy(&nonce)) {
        response.headers_mut().insert(header::CONTENT_SECURITY_POLICY, policy);
    }
    response
}

/// Carries out an order of the page, in JSON, in a thread of its own. A form of another website can send no JSON.
async fn command(State(context): State<Context>, headers: HeaderMap, body: Bytes) -> Response {
    if headers.get(header::CONTENT_TYPE).is_none_or(|kind| kind != JSON) {
        return (StatusCode::UNSUPPORTED_MEDIA_TYPE, "an order is JSON").into_response();
    }
    let (of, answer) = match &context.content {
        ServerContent::Live => match serde_json::from_slice(&body) {
            Ok(order) => ("a flight under way", Ok(context.carry_out(order).await)),
            Err(error) => ("a flight under way", Err(error)),
        },
        ServerContent::Recorded(player) => {
            let answer = serde_json::from_slice(&body).map(|order: PlayOrder| player.carry_out(&order));
            ("a recorded flight", answer)
        }
        ServerContent::Document(_) => return (StatusCode::NOT_FOUND, "a campaign takes no orders").into_response(),
    };
    match answer {
        Ok(answer) => {
            ([(header::CONTENT_TYPE, JSON)], serde_json::to_string(&answer).unwrap_or_default()).into_response()
        }
        Err(error) => (StatusCode::UNPROCESSABLE_ENTITY, format!("no order to {of}: {error}")).into_response(),
    }
}

async fn follow(State(context): State<Context>, upgrade: WebSocketUpgrade) -> Response {
    limited(upgrade).on_upgrade(move |socket| send_frames(socket, context.hub))
}

/// Limits the memory that a client can make this process use: a frame is read whole before it is part of a message.
fn limited(upgrade: WebSocketUpgrade) -> WebSocketUpgrade {
    upgrade.max_message_size(MESSAGE_BYTES).max_frame_size(MESSAGE_BYTES)
}

async fn foxglove_socket(State(context): State<Context>, headers: HeaderMap, upgrade: WebSocketUpgrade) -> Response {
    let why = match context.content {
        ServerContent::Live => None,
        ServerContent::Recorded(_) => {
            Some("the messages of a recorded flight are in its flight.mcap, which Foxglove opens")
        }
        ServerContent::Document(_) => Some("a campaign keeps no messages"),
    };
    if let Some(why) = why {
        return (StatusCode::NOT_FOUND, why).into_response();
    }
    if !foxglove::is_spoken(&headers) {
        let why = format!("a client of Foxglove's protocol offers one of {:?}", foxglove::PROTOCOLS);
        return (StatusCode::BAD_REQUEST, why).into_response();
    }
    limited(upgrade).protocols(foxglove::PROTOCOLS).on_upgrade(move |socket| foxglove::serve(socket, context.hub))
}

/// Sends a page the newest frames, and then every further one, until the page leaves or does not read.
async fn send_frames(mut socket: WebSocket, hub: Arc<Hub>) {
    let (first, mut frames) = hub.join();
    for frame in first {
        if !send(&mut socket, Message::Text(frame)).await {
            return;
        }
    }
    loop {
        let frame: Utf8Bytes = tokio::select! {
            frame = frames.recv() => match frame {
                Ok(frame) => frame,
                Err(RecvError::Lagged(_)) => continue, // the oldest frames are lost
                Err(RecvError::Closed) => return,
            },
            received = socket.recv() => match received {
                Some(Ok(_)) => continue, // messages of the page are ignored
                Some(Err(_)) | None => return,
            },
        };
        if !send(&mut socket, Message::Text(frame)).await {
            return;
        }
    }
}
