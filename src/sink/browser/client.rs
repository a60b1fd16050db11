//! Connection to one page: frames to it, requests from it.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use bytes::Bytes;
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt as _, StreamExt as _};
use tokio::sync::mpsc::error::TrySendError;
use tokio::sync::{mpsc, watch};
use tokio::time::{MissedTickBehavior, interval, timeout};

use super::messages::{self, Request, ToPage};
use super::shared::{Client, ClientCounters, ClientSlot, FrameSet, Shared};
use crate::settings::{Assignment, Control};

/// Largest number of frames that are sent but not yet drawn: one is in transit while another is drawn.
const FRAMES_UNDER_WAY: usize = 2;
/// Longest time to send a message, after which the page counts as gone.
const SEND_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest silence of a page, after which the page counts as gone.
const SILENCE_TIMEOUT: Duration = Duration::from_secs(30);
const PING_PERIOD: Duration = Duration::from_secs(10);
const STATS_PERIOD: Duration = Duration::from_secs(1);
/// Largest number of changes of marks by one page: more than a session of measuring needs, less than a recording can
/// hold.
const MARKS_MAX: u64 = 10_000;
/// Capacity of the queue from the reading to the writing half. While it is full, the page's messages are not read.
const ANSWERS: usize = 16;

/// Messages from the reading half to the writing half of a connection.
enum Heard {
    Drawn(u64),
    Overlays,
    Mistake(String),
}

/// Turns a page away because all slots are taken.
pub(super) async fn turn_away(mut socket: WebSocket, reason: String) {
    let close = CloseFrame { code: close_code::AGAIN, reason: reason.into() };
    // The page may have gone already.
    let _ = timeout(SEND_TIMEOUT, socket.send(Message::Close(Some(close)))).await;
}

/// Serves a page until it leaves or the station ends.
pub(super) async fn run(socket: WebSocket, slot: ClientSlot) {
    let (shared, client) = (&slot.shared, &slot.client);
    tracing::info!("page {} watches from {}", client.id, client.address);
    let (sender, receiver) = socket.split();
    let (heard, hears) = mpsc::channel(ANSWERS);
    let why = tokio::select! {
        why = read(receiver, shared, client, heard) => why,
        why = Writer::new(sender, shared, client).run(hears) => why,
    };
    let ClientCounters { id, sent, dropped, .. } = client.counters();
    tracing::info!("page {id} {why}; {sent} frames sent, {dropped} dropped");
}

/// Handles the page's messages. Returns the reason why the connection ended.
async fn read(
    mut receiver: SplitStream<WebSocket>,
    shared: &Shared,
    client: &Client,
    heard: mpsc::Sender<Heard>,
) -> &'static str {
    loop {
        let message = match timeout(SILENCE_TIMEOUT, receiver.next()).await {
            Err(_) => return "fell silent",
            Ok(None | Some(Ok(Message::Close(_)))) => return "left",
            Ok(Some(Err(e))) => {
                tracing::debug!("page {}: {e}", client.id);
                return "broke off";
            }
            Ok(Some(Ok(message))) => message,
        };
        let request = match message {
            Message::Text(text) => messages::read(text.as_str()),
            Message::Binary(_) => Err("a page sends text, not binary messages".to_owned()),
            Message::Ping(_) | Message::Pong(_) | Message::Close(_) => continue,
        };
        let told = match request {
            Ok(Request::Drawn { number }) => Heard::Drawn(number),
            Ok(Request::Overlays { segmentation, attenuation }) => {
                client.segmentation.store(segmentation, Ordering::Relaxed);
                client.attenuation.store(attenuation, Ordering::Relaxed);
                Heard::Overlays
            }
            Ok(Request::Set { assignments }) => match set(shared, assignments) {
                Ok(()) => continue,
                Err(mistake) => Heard::Mistake(mistake),
            },
            Ok(Request::Mark(mark)) => match note(shared, client, Control::Mark(mark)) {
                Ok(()) => continue,
                Err(mistake) => Heard::Mistake(mistake),
            },
            Ok(Request::Unmark { ids }) => match note(shared, client, Control::Unmark(ids)) {
                Ok(()) => continue,
                Err(mistake) => Heard::Mistake(mistake),
            },
            Err(mistake) => Heard::Mistake(mistake),
        };
        if heard.send(told).await.is_err() {
            return "ended";
        }
    }
}

/// Passes new values of settings to the session.
///
/// # Errors
/// The page doesn't offer a value, or the session accepts none at the moment; the error is a text for the page.
fn set(shared: &Shared, assignments: Vec<Assignment>) -> Result<(), String> {
    shared.check_offered(&assignments).map_err(|refused| format!("not set: {refused}"))?;
    pass_on(shared, Control::Set(assignments)).map_err(str::to_owned)
}

/// Passes a page's marks to the session, for its recording.
///
/// # Errors
/// The page has changed too many marks, or the session accepts none at the moment; the error is a text for the page.
fn note(shared: &Shared, client: &Client, control: Control) -> Result<(), String> {
    if client.marks.fetch_add(1, Ordering::Relaxed) >= MARKS_MAX {
        return Err(format!("not recorded: this page has changed {MARKS_MAX} marks; load it again"));
    }
    pass_on(shared, control).map_err(|reason| format!("the mark is not recorded: {reason}"))
}

fn pass_on(shared: &Shared, control: Control) -> Result<(), &'static str> {
    shared.controls.try_send(control).map_err(|unsent| match unsent {
        TrySendError::Full(_) => "the station is busy; try again",
        TrySendError::Closed(_) => "the station takes no controls any more",
    })
}

struct Writer<'a> {
    sender: SplitSink<WebSocket, Message>,
    shared: &'a Shared,
    client: &'a Client,
    frames: watch::Receiver<Option<Arc<FrameSet>>>,
    /// Numbers of the frames that are sent but not yet drawn.
    under_way: VecDeque<u64>,
    /// Sequence number of the last frame sent; 0 before the first.
    last: u64,
}

impl<'a> Writer<'a> {
    fn new(sender: SplitSink<WebSocket, Message>, shared: &'a Shared, client: &'a Client) -> Self {
        let under_way = VecDeque::with_capacity(FRAMES_UNDER_WAY + 1);
        let mut frames = shared.frames.clone();
        frames.mark_changed();
        Self { sender, shared, client, frames, under_way, last: 0 }
    }

    /// Sends messages until the page leaves or the station ends. Returns the reason why the connection ended.
    async fn run(mut self, mut hears: mpsc::Receiver<Heard>) -> &'static str {
        match self.try_run(&mut hears).await {
            Ok(why) => why,
            Err(why) => why,
        }
    }

    async fn try_run(&mut self, hears: &mut mpsc::Receiver<Heard>) -> Result<&'static str, &'static str> {
        let shared = self.shared;
        let [mut stats, mut pings] = [STATS_PERIOD, PING_PERIOD].map(interval);
        stats.set_missed_tick_behavior(MissedTickBehavior::Skip);
        pings.set_missed_tick_behavior(MissedTickBehavior::Skip);
        self.send(Message::text(shared.hello.clone())).await?;
        loop {
            let room = self.under_way.len() < FRAMES_UNDER_WAY;
            tokio::select! {
                biased;
                () = shared.cancel.cancelled() => {
                    let close = CloseFrame { code: close_code::AWAY, reason: "the station ends".into() };
                    self.send(Message::Close(Some(close))).await?;
                    return Ok("was told that the station ends");
                }
                heard = hears.recv() => match heard {
                    Some(Heard::Drawn(number)) => self.under_way.retain(|&sent| sent > number),
                    Some(Heard::Overlays) => self.repeat().await?,
                    Some(Heard::Mistake(message)) => {
                        self.send(Message::text(messages::write(&ToPage::Error { message: &message }))).await?;
                    }
                    None => return Ok("ended"),
                },
                _ = stats.tick() => {
                    let ClientCounters { sent, dropped, .. } = self.client.counters();
                    let stats = ToPage::Stats { sent, dropped, clients: shared.client_count() };
                    self.send(Message::text(messages::write(&stats))).await?;
                }
                _ = pings.tick() => self.send(Message::Ping(Bytes::new())).await?,
                changed = self.frames.changed(), if room => {
                    if changed.is_err() {
                        return Ok("ended with the sink");
                    }
                    self.newest().await?;
                }
            }
        }
    }

    /// Sends the newest frame, and counts the frames that the page missed since the last one.
    async fn newest(&mut self) -> Result<(), &'static str> {
        let Some(set) = self.frames.borrow_and_update().clone() else { return Ok(()) };
        if self.last > 0 {
            let missed = set.sequence.saturating_sub(self.last + 1);
            self.client.dropped.fetch_add(missed, Ordering::Relaxed);
        }
        self.last = set.sequence;
        // Counted before it is sent, so that whoever has received the frame finds it counted.
        self.client.sent.fetch_add(1, Ordering::Relaxed);
        self.send_set(&set).await
    }

    /// Sends the current frame again with newly requested overlays, because a frozen frame has no successor.
    async fn repeat(&mut self) -> Result<(), &'static str> {
        let set = self.frames.borrow().clone();
        let room = self.under_way.len() <= FRAMES_UNDER_WAY;
        match set {
            Some(set) if set.sequence == self.last && room => self.send_set(&set).await,
            _ => Ok(()),
        }
    }

    async fn send_set(&mut self, set: &FrameSet) -> Result<(), &'static str> {
        let wanted = self.client.overlays();
        let segmentation = set.segmentation.as_ref().filter(|_| wanted.segmentation);
        let attenuation = set.attenuation.as_ref().filter(|_| wanted.attenuation);
        for map in [segmentation, attenuation].into_iter().flatten() {
            self.send(Message::Binary(map.clone())).await?;
        }
        self.send(Message::Binary(set.image.clone())).await?;
        self.under_way.push_back(set.number);
        Ok(())
    }

    async fn send(&mut self, message: Message) -> Result<(), &'static str> {
        match timeout(SEND_TIMEOUT, self.sender.send(message)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(e)) => {
                tracing::debug!("page {}: {e}", self.client.id);
                Err("broke off")
            }
            Err(_) => Err("takes nothing any more"),
        }
    }
}
