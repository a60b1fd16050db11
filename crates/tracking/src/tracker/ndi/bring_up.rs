//! Set-up of a device from any state to tracking: the commands, and the next step after each answer.

use std::collections::VecDeque;
use std::fmt::Write;
use std::time::Duration;

use super::{BAUD_RATES, Options, Reason, ReplyFormat, reply};
use crate::tracker::framing::quote;

/// Number of bytes of a tool description that one command writes.
const ROM_BLOCK: usize = 64;

/// A command to the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// Reset, by a break of the line or by command.
    Reset,
    /// Ends tracking.
    Stop,
    /// Initialises the system.
    Init,
    /// Sets the speed of the line.
    Comm,
    /// Lists handles that are not in use.
    ListStale,
    /// Frees a handle.
    Free(u8),
    /// Requests a handle for the wireless tool of this index.
    Request(usize),
    /// Writes a block of the tool's description.
    Write { tool: usize, handle: u8, block: usize },
    /// Lists handles to initialise.
    ListUninitialised,
    /// Initialises a handle.
    Initialise(u8),
    /// Lists handles to enable.
    ListDisabled,
    /// Enables a handle.
    Enable(u8),
    /// Starts tracking with the frame counter at 0.
    Start,
    /// Starts tracking on a device that refuses the option of `Start`.
    StartPlain,
    /// Requests poses.
    Poll,
}

impl Step {
    /// Time limit for the answer.
    pub(super) fn timeout(self) -> Duration {
        Duration::from_millis(match self {
            Self::Reset => 12_000,
            Self::Init | Self::Initialise(_) | Self::Start | Self::StartPlain | Self::Stop => 4000,
            Self::Poll => 500,
            _ => 2000,
        })
    }

    /// Command without its checksum.
    pub(super) fn command(self, options: &Options) -> String {
        match self {
            Self::Reset => "RESET:".to_owned(),
            Self::Stop => "TSTOP:".to_owned(),
            Self::Init => "INIT:".to_owned(),
            Self::Comm => {
                let index = options.baud.and_then(|baud| BAUD_RATES.iter().position(|&rate| rate == baud));
                // 8 data bits, no parity, one stop bit, no handshake.
                format!("COMM:{}0000", index.unwrap_or(0))
            }
            Self::ListStale => "PHSR:01".to_owned(),
            Self::Free(handle) => format!("PHF:{handle:02X}"),
            Self::Request(_) => "PHRQ:*********1****".to_owned(),
            Self::Write { tool, handle, block } => {
                let mut text = format!("PVWR:{handle:02X}{:04X}", block * ROM_BLOCK);
                let rom = options.roms.get(tool).map_or(&[][..], Vec::as_slice);
                for i in 0..ROM_BLOCK {
                    let byte = rom.get(block * ROM_BLOCK + i).copied().unwrap_or(0);
                    // Writing to a String can't fail.
                    let _ = write!(text, "{byte:02X}");
                }
                text
            }
            Self::ListUninitialised => "PHSR:02".to_owned(),
            Self::Initialise(handle) => format!("PINIT:{handle:02X}"),
            Self::ListDisabled => "PHSR:03".to_owned(),
            Self::Enable(handle) => format!("PENA:{handle:02X}D"),
            Self::Start => "TSTART:80".to_owned(),
            Self::StartPlain => "TSTART:".to_owned(),
            Self::Poll => {
                let name = if options.format == ReplyFormat::Binary { "BX" } else { "TX" };
                format!("{name}:{}", if options.out_of_volume { "0801" } else { "0001" })
            }
        }
    }
}

/// Next step after an answer.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Next {
    /// The next command.
    Ask(Step),
    /// The next command, after changing the speed of the line.
    ChangeSpeed(Step),
    /// No tool is connected: search again after a pause.
    NoTool,
    /// The answer is wrong; start over.
    Fail(Reason),
}

/// State of the device's handles.
#[derive(Debug, Clone, Default)]
pub(super) struct BringUp {
    queue: VecDeque<u8>,
    /// Handles whose initialisation succeeded or failed.
    settled: Vec<u8>,
    /// Number of enabled handles.
    enabled: usize,
    /// Whether the line has the requested speed.
    pub(super) speed_is_set: bool,
    /// Whether all tool descriptions were written since the last reset of the device.
    written: bool,
    initialised: bool,
    /// Whether tracking of an earlier session was stopped.
    stopped: bool,
}

impl BringUp {
    /// Forgets the state that a reset or an `INIT` invalidates.
    pub(super) fn reset(&mut self) {
        *self = Self { speed_is_set: self.speed_is_set, ..Self::default() };
    }

    /// Forgets the handles before they are listed again; tool descriptions remain written.
    pub(super) fn reset_ports(&mut self) {
        self.queue.clear();
        self.settled.clear();
    }

    /// Step after the device answered `text` to `step`.
    pub(super) fn after(&mut self, step: Step, text: &str, options: &Options) -> Next {
        let is_okay = text == "OKAY";
        let unexpected = || {
            let command = step.command(options);
            Next::Fail(Reason::Unexpected { text: quote(text.as_bytes()), command })
        };
        match step {
            Step::Reset => Next::Ask(Step::Init),
            Step::ListStale | Step::ListUninitialised | Step::ListDisabled => match reply::handles(text) {
                Ok(handles) => self.listed(step, handles, options),
                Err(reason) => Next::Fail(reason),
            },
            Step::Request(tool) => match (text.len(), u8::from_str_radix(text, 16)) {
                (2, Ok(handle)) => Next::Ask(Step::Write { tool, handle, block: 0 }),
                _ => unexpected(),
            },
            _ if !is_okay => unexpected(),
            Step::Init => {
                self.reset();
                self.initialised = true;
                Next::Ask(if options.baud.is_some() && !self.speed_is_set { Step::Comm } else { Step::ListStale })
            }
            Step::Comm => Next::ChangeSpeed(Step::ListStale),
            Step::Stop => Next::Ask(if self.initialised { Step::ListStale } else { Step::Init }),
            Step::Write { tool, handle, block } if (block + 1) * ROM_BLOCK < super::ROM_BYTES => {
                Next::Ask(Step::Write { tool, handle, block: block + 1 })
            }
            Step::Write { tool, .. } => Next::Ask(self.request(tool + 1, options)),
            Step::Enable(_) => {
                self.enabled += 1;
                self.next_in_phase(step, options)
            }
            Step::Free(_) | Step::Initialise(_) => self.next_in_phase(step, options),
            Step::Start | Step::StartPlain | Step::Poll => Next::Ask(Step::Poll),
        }
    }

    /// Step after the device refused `step`; `None` if the device must be set up from the start.
    pub(super) fn after_refusal(&mut self, step: Step, code: u8, options: &Options) -> Option<Next> {
        const WRONG_MODE: u8 = 0x0C;
        match step {
            // The device is still tracking, because an earlier session didn't stop it.
            Step::Init if code == WRONG_MODE && !std::mem::replace(&mut self.stopped, true) => {
                Some(Next::Ask(Step::Stop))
            }
            Step::Start => Some(Next::Ask(Step::StartPlain)),
            Step::Write { tool, handle, .. } => {
                self.settled.push(handle);
                Some(Next::Ask(self.request(tool + 1, options)))
            }
            Step::Request(tool) => Some(Next::Ask(self.request(tool + 1, options))),
            Step::Free(_) | Step::Initialise(_) | Step::Enable(_) => Some(self.next_in_phase(step, options)),
            _ => None,
        }
    }

    fn listed(&mut self, step: Step, mut handles: Vec<u8>, options: &Options) -> Next {
        if step == Step::ListUninitialised {
            handles.retain(|handle| !self.settled.contains(handle));
            self.settled.extend(&handles);
        }
        self.queue = handles.into();
        self.next_in_phase(step, options)
    }

    /// Next step in the phase of `step` for the next queued handle, or the first step of the next phase.
    fn next_in_phase(&mut self, step: Step, options: &Options) -> Next {
        let handle = self.queue.pop_front();
        Next::Ask(match (step, handle) {
            (Step::ListStale | Step::Free(_), Some(handle)) => Step::Free(handle),
            (Step::ListStale | Step::Free(_), None) if self.written => Step::ListUninitialised,
            (Step::ListStale | Step::Free(_), None) => self.request(0, options),
            (Step::ListUninitialised | Step::Initialise(_), Some(handle)) => Step::Initialise(handle),
            // A tool with several parts lists its second handle only after the first one is initialised.
            (Step::Initialise(_), None) => Step::ListUninitialised,
            (Step::ListUninitialised, None) => Step::ListDisabled,
            (Step::ListDisabled | Step::Enable(_), Some(handle)) => Step::Enable(handle),
            (_, _) if self.enabled == 0 => return Next::NoTool,
            (_, _) => Step::Start,
        })
    }

    fn request(&mut self, tool: usize, options: &Options) -> Step {
        self.written = tool >= options.roms.len();
        if self.written { Step::ListUninitialised } else { Step::Request(tool) }
    }
}
