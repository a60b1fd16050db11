//! Reception of a session's records, faults and events: selects the records of probe and needle, counts them, and
//! reports problems.

use std::net::SocketAddr;
use std::time::Duration;

use super::SessionSummary;
use super::advice::Advisor;
use super::damage_watch::DamageWatch;
use super::regularity::Regularity;
use crate::tracker::selection::{Selection, Verdict};
use crate::tracker::settings::Settings;
use crate::tracker::{AxisMap, DecodeError, Listener, ProbeSensor, Record, TrackerEvent, TrackerStream};

/// Shortest time between two reports of other senders.
const SENDER_PERIOD: Duration = Duration::from_secs(5);

/// Number of other senders' datagrams from which a second sender is reported. The first two may come from a sender
/// that uses a new port for each datagram; its third datagram shows that.
const SENDER_FROM: u64 = 3;

/// Receiver of everything that a session decodes.
pub(super) struct Intake {
    listener: Box<dyn Listener>,
    axis_map: AxisMap,
    selection: Selection,
    /// Bit set of the left-out sensors that were reported on this connection.
    reported: u64,
    damage: DamageWatch,
    regularity: Regularity,
    advisor: Advisor,
    /// Time without a record of the probe after which its absence is reported, if other sensors are received.
    patience: Duration,
    /// Time of the probe's last record, or of opening the port.
    probe_at: Duration,
    /// Whether the probe's absence was reported.
    missing_told: bool,
    /// Time of opening the port.
    opened_at: Duration,
    /// Whether the needle's absence was reported on this connection.
    needle_told: bool,
    /// Time of the last report of other senders; `None` before the first.
    sender_told: Option<Duration>,
    /// Numbers of bytes and records since the port was opened.
    connection: (u64, u64),
    pub(super) summary: SessionSummary,
}

impl Intake {
    pub(super) fn new(
        settings: &Settings,
        TrackerStream { protocol, sensor, needle }: TrackerStream,
        listener: Box<dyn Listener>,
    ) -> Self {
        Self {
            listener,
            axis_map: settings.axis_map,
            selection: Selection::new(sensor, needle),
            reported: 0,
            damage: DamageWatch::default(),
            regularity: Regularity::default(),
            advisor: Advisor::new(settings, protocol),
            patience: settings.device.silence,
            probe_at: Duration::ZERO,
            missing_told: false,
            opened_at: Duration::ZERO,
            needle_told: false,
            sender_told: None,
            connection: (0, 0),
            summary: SessionSummary::default(),
        }
    }

    /// Handles the opening of the port.
    pub(super) fn opened(&mut self, now: Duration, host_ns: u64, port: String) {
        self.summary.connections += 1;
        self.summary.cause = None;
        (self.reported, self.connection) = (0, (0, 0));
        self.advisor.forget();
        (self.probe_at, self.opened_at) = (now, now);
        (self.missing_told, self.needle_told) = (false, false);
        self.event(host_ns, &TrackerEvent::Connected { port });
    }

    /// Handles the loss of the port, or the failure to open it; `reason` says why.
    pub(super) fn lost(&mut self, reason: &str) {
        if self.summary.connections == 0 {
            self.summary.cause = Some(format!("it could not be opened: {reason}"));
        }
    }

    /// Handles a restart of the device, after which its counter and clock may restart, too.
    pub(super) fn restarted(&mut self) {
        self.regularity.restart();
    }

    /// Takes received bytes before they are decoded.
    pub(super) fn bytes(&mut self, host_ns: u64, piece: &[u8]) {
        self.summary.bytes += piece.len() as u64;
        self.connection.0 += piece.len() as u64;
        self.advisor.bytes(piece);
        self.listener.bytes(host_ns, piece);
    }

    /// Takes a decoded record of any sensor.
    pub(super) fn record(&mut self, now: Duration, host_ns: u64, mut record: Record, name: Option<&str>) {
        self.damage.record();
        self.connection.1 += 1;
        let before = self.selection.heard().len();
        let (verdict, at) = self.selection.judge(&mut record, name);
        let is_new = self.selection.heard().len() > before;
        let record = self.axis_map.apply(record);
        if let Some(sensor) = at.and_then(|at| self.selection.heard().get(at)) {
            self.listener.heard(host_ns, sensor, &record);
        }
        match verdict {
            Verdict::Probe => {
                if is_new && self.selection.wanted() == Some(&ProbeSensor::Only) && name.is_some() {
                    let tool = self.selection.used().cloned();
                    tool.into_iter().for_each(|tool| self.event(host_ns, &TrackerEvent::OnlyTool { tool }));
                }
                (self.probe_at, self.missing_told) = (now, false);
                self.summary.records += 1;
                self.listener.record(host_ns, &record);
                if let Some(irregularity) = self.regularity.push(host_ns, &record) {
                    self.event(host_ns, &TrackerEvent::Irregular(irregularity));
                }
            }
            Verdict::Needle => {
                self.summary.needle_records += 1;
                self.listener.needle_record(host_ns, &record);
                self.report_missing_probe(now, host_ns);
            }
            Verdict::Other => self.other(now, host_ns, at),
            Verdict::Undecided => {
                self.summary.other_sensor += 1;
                if is_new {
                    let heard = self.selection.heard().to_vec();
                    self.event(host_ns, &TrackerEvent::Undecided { heard });
                }
            }
        }
        self.report_missing_needle(now, host_ns);
    }

    /// Takes a record of a sensor that is of no tool.
    fn other(&mut self, now: Duration, host_ns: u64, at: Option<usize>) {
        self.summary.other_sensor += 1;
        let bit = 1 << at.unwrap_or(63).min(63);
        if self.reported & bit == 0 {
            self.reported |= bit;
            if let Some(sensor) = at.and_then(|at| self.selection.heard().get(at)).cloned() {
                let used = self.selection.used().cloned();
                self.event(host_ns, &TrackerEvent::OtherSensor { sensor, used });
            }
        }
        self.report_missing_probe(now, host_ns);
    }

    /// Reports the probe's absence once, if it has lasted.
    fn report_missing_probe(&mut self, now: Duration, host_ns: u64) {
        let for_ = now.saturating_sub(self.probe_at);
        if let (false, true, Some(wanted)) = (self.missing_told, for_ >= self.patience, self.selection.wanted()) {
            let (wanted, heard) = (wanted.clone(), self.selection.heard().to_vec());
            self.missing_told = true;
            self.event(host_ns, &TrackerEvent::ProbeMissing { wanted, for_, heard });
        }
    }

    /// Reports once per connection that the needle was never heard. A needle that was heard before has a tracking state.
    fn report_missing_needle(&mut self, now: Duration, host_ns: u64) {
        let for_ = now.saturating_sub(self.opened_at);
        if self.needle_told || for_ < self.patience {
            return;
        }
        if let Some(wanted) = self.selection.missing_needle().cloned() {
            self.needle_told = true;
            let heard = self.selection.heard().to_vec();
            self.event(host_ns, &TrackerEvent::NeedleMissing { wanted, for_, heard });
        }
    }

    /// Takes a damaged piece, or an error reported by the device.
    pub(super) fn fault(&mut self, now: Duration, host_ns: u64, error: DecodeError) {
        self.summary.decode_errors += 1;
        self.damage.push(&error, now);
        self.event(host_ns, &TrackerEvent::DecodeError(error));
    }

    /// Takes a datagram of another sender, which is left out.
    pub(super) fn other_sender(&mut self, now: Duration, host_ns: u64, other: SocketAddr, used: SocketAddr) {
        self.summary.other_sender += 1;
        if self.summary.other_sender < SENDER_FROM {
            return;
        }
        let is_due = self.sender_told.is_none_or(|at| now.saturating_sub(at) >= SENDER_PERIOD);
        if is_due {
            self.sender_told = Some(now);
            let left_out = self.summary.other_sender;
            self.event(host_ns, &TrackerEvent::OtherSender { other, used, left_out });
        }
    }

    /// Passes on an event.
    pub(super) fn event(&mut self, host_ns: u64, event: &TrackerEvent) {
        self.listener.event(host_ns, event);
    }

    /// Time at which [`Self::tell`] has something to report; `None` if there is nothing.
    pub(super) fn due_at(&self) -> Option<Duration> {
        self.damage.due_at()
    }

    /// Reports the damage of the last seconds when it is due, and in any case at the `end` of a connection.
    pub(super) fn tell(&mut self, now: Duration, host_ns: u64, end: bool) {
        match self.damage.due_at() {
            Some(due) if now >= due || end => {
                let (damaged, records) = self.damage.counts();
                let remedy = self.advisor.of_damage(damaged, records);
                if let Some(damage) = self.damage.report(now, remedy) {
                    self.event(host_ns, &TrackerEvent::Damaged(damage));
                }
            }
            Some(_) => {}
            None => self.damage.refresh(now),
        }
    }

    /// Likely cause of silence; `None` if a record has arrived since the port was opened.
    pub(super) fn cause_of_silence(&self, skipped: Option<String>) -> Option<String> {
        let (bytes, records) = self.connection;
        if records == 0 { self.advisor.of_silence(bytes, self.summary.decode_errors, skipped) } else { None }
    }

    /// Totals of the session, with the likely cause if there was no record.
    pub(super) fn finish(mut self, skipped: Option<String>) -> SessionSummary {
        self.summary.heard = self.selection.heard().to_vec();
        self.summary.undecided = self.selection.is_undecided();
        if self.summary.records == 0 && self.summary.connections > 0 && self.selection.heard().is_empty() {
            self.summary.cause = self.cause_of_silence(skipped);
        }
        self.summary
    }
}
