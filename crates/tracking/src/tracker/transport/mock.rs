//! Mock transport: the simulated board in real time.

use std::io;

use bytes::BytesMut;
use tokio::time::{Instant, sleep_until};

use super::Received;
use crate::tracker::mock::{Board, Settings, Tick};

/// Port of a simulated board, which also ticks while the port is closed.
pub(in crate::tracker) struct MockPort {
    board: Board,
    /// Time of the first opening; `None` before it.
    started: Option<Instant>,
    plugged: bool,
}

impl MockPort {
    pub(super) fn new(settings: Settings) -> Self {
        Self { board: Board::new(settings), started: None, plugged: true }
    }

    pub(super) fn open(&mut self) -> io::Result<String> {
        let started = *self.started.get_or_insert_with(Instant::now);
        // Lines sent while the port was closed are lost.
        while started + self.board.next_at() < Instant::now() {
            self.plugged = self.board.tick() != Tick::Unplugged;
        }
        if self.plugged { Ok("a mock".to_owned()) } else { Err(unplugged()) }
    }

    pub(super) async fn receive(&mut self, piece: &mut BytesMut) -> io::Result<Received> {
        let started = *self.started.get_or_insert_with(Instant::now);
        loop {
            sleep_until(started + self.board.next_at()).await;
            match self.board.tick() {
                Tick::Line(line) => {
                    piece.extend_from_slice(&line);
                    return Ok(Received::Bytes { time_ns: None });
                }
                Tick::Nothing => {}
                Tick::Unplugged => {
                    self.plugged = false;
                    return Err(unplugged());
                }
            }
        }
    }
}

fn unplugged() -> io::Error {
    io::Error::new(io::ErrorKind::NotConnected, "the mock's schedule says that it is unplugged")
}
