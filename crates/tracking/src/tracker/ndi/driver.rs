//! Driver of NDI devices: host side of the Combined API.

use std::collections::VecDeque;
use std::time::Duration;

use bytes::{Bytes, BytesMut};

use super::bring_up::{BringUp, Next, Step};
use super::decoder::{Repeats, error_code};
use super::frame::{Framer, Item};
use super::{Options, Reason, START_BAUD, framed};
use crate::tracker::driver::{Driver, Line};
use crate::tracker::{DecodeError, Record};

/// Pause between `COMM` and changing the line's speed.
const SPEED_PAUSE: Duration = Duration::from_millis(100);

/// Pause between a failure and the next attempt.
const RETRY_PAUSE: Duration = Duration::from_millis(200);

/// Pause between two searches for a tool.
const NO_TOOL_PAUSE: Duration = Duration::from_secs(1);

/// Shortest interval between interruptions of tracking to handle added or removed tools.
const CHANGE_PAUSE: Duration = Duration::from_secs(2);

/// Number of consecutive lost or refused requests after which the device is set up again.
const POLL_FAILURES: u32 = 3;

/// Number of failed set-ups after which the device is reset.
const SET_UP_FAILURES: u32 = 3;

/// Largest number of consecutive timeouts that are reported one by one. After that the device counts as silent, which
/// the session reports.
const NOTICES_LIMIT: usize = 8;

/// Number of searches for a tool per report that there is none.
const NO_TOOL_POLLS: u32 = 10;

/// Bit of the system status: a port was newly occupied.
const PORT_OCCUPIED: u16 = 0x0040;

/// Way of contacting a silent device, by attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Approach {
    /// Communicate at the speed after power-on.
    StartSpeed,
    /// Communicate at the speed that an earlier session set.
    SetSpeed,
    /// Reset the device.
    Reset,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    Idle,
    /// Command to be sent, not before this time.
    Ask(Step, Duration),
    /// Command sent at this time.
    Asked(Step, Duration),
}

/// Driver that brings one device to tracking, requests poses, and starts over after failures.
///
/// Attempt 0 uses the start speed, then the speed that an earlier session may have set. Later attempts reset the
/// device, by a break of the serial line or the command `RESET`.
pub struct NdiDriver {
    options: Options,
    poll: Bytes,
    framer: Framer,
    repeats: Repeats,
    bring_up: BringUp,
    approach: Approach,
    state: State,
    line: VecDeque<Line>,
    /// Errors not caused by received bytes.
    notices: VecDeque<Reason>,
    poll_failures: u32,
    set_up_failures: u32,
    /// Number of unsuccessful searches for a tool since the device last tracked.
    no_tool: u32,
    /// System status and number of absent ports in the previous reply; `None` before the first.
    tracked: Option<(u16, u16)>,
    changed_at: Duration,
}

impl NdiDriver {
    /// Driver of a device with [valid](Options::validate) `options`; idle before [`Driver::start`].
    pub fn new(options: Options) -> Self {
        Self {
            poll: framed(&Step::Poll.command(&options)),
            options,
            framer: Framer::default(),
            repeats: Repeats::default(),
            bring_up: BringUp::default(),
            approach: Approach::StartSpeed,
            state: State::Idle,
            line: VecDeque::new(),
            notices: VecDeque::new(),
            poll_failures: 0,
            set_up_failures: 0,
            no_tool: 0,
            tracked: None,
            changed_at: Duration::ZERO,
        }
    }

    /// Whether the device is tracking.
    pub fn is_tracking(&self) -> bool {
        matches!(self.state, State::Ask(Step::Poll, _) | State::Asked(Step::Poll, _))
    }

    fn begin(&mut self, now: Duration, approach: Approach) {
        self.approach = approach;
        self.bring_up.reset();
        self.tracked = None;
        self.poll_failures = 0;
        self.line.clear();
        let baud = self.options.baud.unwrap_or(START_BAUD);
        let speed = if approach == Approach::SetSpeed { baud } else { START_BAUD };
        self.bring_up.speed_is_set = speed == baud;
        if self.options.baud.is_some() {
            self.line.push_back(Line::Speed(speed));
        }
        let step = if approach == Approach::Reset { Step::Reset } else { Step::Init };
        if step == Step::Reset {
            self.line.push_back(Line::Break);
        }
        self.state = State::Ask(step, now);
    }

    /// Sets the device up again from `INIT`; after several consecutive failures, resets it.
    fn fail(&mut self, now: Duration) {
        self.set_up_failures += 1;
        self.bring_up.reset();
        self.tracked = None;
        if self.set_up_failures > SET_UP_FAILURES {
            self.set_up_failures = 0;
            self.begin(now + RETRY_PAUSE, Approach::Reset);
        } else {
            self.state = State::Ask(Step::Init, now + RETRY_PAUSE);
        }
    }

    fn timed_out(&mut self, now: Duration, step: Step) {
        let (command, waited) = (step.command(&self.options), step.timeout());
        if self.notices.len() < NOTICES_LIMIT {
            self.notices.push_back(Reason::NoReply { command, waited_ms: waited.as_millis() as u64 });
        }
        self.framer.give_up();
        match step {
            Step::Poll => self.poll_failed(now),
            Step::Init | Step::Reset => {
                let next = match self.approach {
                    Approach::StartSpeed if self.options.baud.is_some_and(|baud| baud != START_BAUD) => {
                        Approach::SetSpeed
                    }
                    // A device that doesn't announce its reset may be ready now.
                    Approach::Reset if step == Step::Reset => {
                        self.state = State::Ask(Step::Init, now);
                        return;
                    }
                    _ => Approach::Reset,
                };
                self.begin(now, next);
            }
            _ => self.fail(now),
        }
    }

    fn poll_failed(&mut self, now: Duration) {
        self.poll_failures += 1;
        if self.poll_failures >= POLL_FAILURES {
            self.poll_failures = 0;
            self.fail(now);
        } else {
            self.state = State::Ask(Step::Poll, now);
        }
    }

    fn advance(&mut self, now: Duration, next: Next) -> Result<(), Reason> {
        match next {
            Next::Ask(step) => self.state = State::Ask(step, now),
            Next::ChangeSpeed(step) => {
                self.bring_up.speed_is_set = true;
                self.line.extend(self.options.baud.map(Line::Speed));
                self.state = State::Ask(step, now + SPEED_PAUSE);
            }
            Next::NoTool => {
                self.state = State::Ask(Step::ListStale, now + NO_TOOL_PAUSE);
                self.no_tool += 1;
                if self.no_tool % NO_TOOL_POLLS == 1 {
                    return Err(Reason::NoTool);
                }
            }
            Next::Fail(reason) => {
                self.fail(now);
                return Err(reason);
            }
        }
        Ok(())
    }

    /// Handles a reply without poses.
    fn text(&mut self, now: Duration, text: &str) -> Result<(), Reason> {
        let asked = match self.state {
            State::Asked(step, _) => Some(step),
            State::Idle | State::Ask(..) => None,
        };
        if text == "RESET" {
            if asked == Some(Step::Reset) {
                return self.advance(now, Next::Ask(Step::Init));
            }
            self.repeats.forget();
            self.begin(now, Approach::StartSpeed);
            return Err(Reason::Restarted);
        }
        // Late answer to a command that timed out.
        let Some(step) = asked else { return Ok(()) };
        let Some(code) = error_code(text) else {
            let next = self.bring_up.after(step, text, &self.options);
            return self.advance(now, next);
        };
        let refused = Reason::Refused { code, command: step.command(&self.options) };
        match self.bring_up.after_refusal(step, code, &self.options) {
            // An alternative command exists.
            Some(next) if matches!(step, Step::Init | Step::Start) => return self.advance(now, next),
            Some(next) => {
                if let Err(reason) = self.advance(now, next) {
                    self.notices.push_back(reason);
                }
            }
            None if step == Step::Poll => self.poll_refused(now, code),
            None => self.fail(now),
        }
        Err(refused)
    }

    fn poll_refused(&mut self, now: Duration, code: u8) {
        const BAD_CRC: u8 = 0x04;
        if code == BAD_CRC {
            return self.poll_failed(now);
        }
        // The device no longer tracks, for example after a silent restart.
        self.fail(now);
    }

    /// Handles the end of a tracking reply.
    fn tracked(&mut self, now: Duration, system_status: u16, absent: u16) {
        self.poll_failures = 0;
        self.set_up_failures = 0;
        self.no_tool = 0;
        let (last_status, last_absent) =
            self.tracked.replace((system_status, absent)).unwrap_or((system_status, absent));
        let plugged = system_status & !last_status & PORT_OCCUPIED != 0;
        let State::Asked(Step::Poll, asked_at) = self.state else { return };
        if (plugged || absent > last_absent) && now >= self.changed_at + CHANGE_PAUSE {
            self.changed_at = now;
            self.tracked = None;
            self.bring_up.reset_ports();
            self.state = State::Ask(Step::Stop, now);
        } else {
            self.state = State::Ask(Step::Poll, now.max(asked_at + self.options.poll_interval));
        }
    }

    /// Handles a piece of the stream that is not a reply.
    fn damaged(&mut self, now: Duration) {
        match self.state {
            // A poll does not change the device's state, so it can be repeated immediately.
            State::Asked(Step::Poll, _) => self.poll_failed(now),
            // Noise is expected on a line whose speed has just changed.
            State::Asked(Step::Init | Step::Reset, _) | State::Ask(..) | State::Idle => {}
            State::Asked(..) => self.fail(now),
        }
    }
}

impl Driver for NdiDriver {
    fn start(&mut self, now: Duration, attempt: u32) {
        self.framer = Framer::default();
        self.notices.clear();
        self.set_up_failures = 0;
        self.no_tool = 0;
        self.repeats.forget();
        self.begin(now, if attempt == 0 { Approach::StartSpeed } else { Approach::Reset });
    }

    fn line(&mut self, now: Duration) -> Option<Line> {
        match self.state {
            // Wait until the device has changed its own speed.
            State::Ask(_, at) if now < at => None,
            _ => self.line.pop_front(),
        }
    }

    fn transmit(&mut self, now: Duration) -> Option<Bytes> {
        if let State::Asked(step, asked_at) = self.state {
            if now < asked_at + step.timeout() {
                return None;
            }
            self.timed_out(now, step);
        }
        let State::Ask(step, at) = self.state else { return None };
        // Pending line operations come first.
        if now < at || !self.line.is_empty() {
            return None;
        }
        self.state = State::Asked(step, now);
        match step {
            Step::Poll => Some(self.poll.clone()),
            // The break on the line already resets the device.
            Step::Reset if self.options.baud.is_some() => None,
            step => Some(framed(&step.command(&self.options))),
        }
    }

    fn wake_at(&self) -> Option<Duration> {
        match self.state {
            State::Idle => None,
            State::Ask(_, at) => Some(at),
            State::Asked(step, at) => Some(at + step.timeout()),
        }
    }

    fn silence_limit(&self) -> Duration {
        // The driver's own timeouts are shorter; this limit applies if the device stays silent through all of them.
        match self.state {
            State::Asked(Step::Poll, _) | State::Ask(Step::Poll, _) => Duration::from_secs(5),
            _ => Duration::from_secs(40),
        }
    }

    fn decode(&mut self, now: Duration, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        loop {
            if let Some(reason) = self.notices.pop_front() {
                return Err(DecodeError { offset: self.framer.item_offset(), fault: reason.into() });
            }
            match self.framer.next(buffer) {
                Err(error) => {
                    self.damaged(now);
                    return Err(error);
                }
                Ok(None) => return Ok(None),
                Ok(Some(Item::Record(record))) if self.repeats.is_new(&record) => return Ok(Some(record)),
                Ok(Some(Item::Record(_))) => {}
                Ok(Some(Item::Tracked { system_status, absent })) => self.tracked(now, system_status, absent),
                Ok(Some(Item::Text(text))) => {
                    let offset = self.framer.item_offset();
                    self.text(now, &text).map_err(|reason| DecodeError { offset, fault: reason.into() })?;
                }
            }
        }
    }

    fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        self.framer.finish(buffer)
    }

    fn stop(&mut self) -> Option<Bytes> {
        let is_tracking = self.is_tracking();
        self.state = State::Idle;
        is_tracking.then(|| framed(&Step::Stop.command(&self.options)))
    }
}
