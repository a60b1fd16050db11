//! Reader of recordings, complete or damaged.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use insonify_core::files::{self, FileError, FileKind};
use mcap::records::{self, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};

use super::{
    EVENT_TOPIC, Entry, Event, FORMAT_VERSION, NEEDLE_POSE_TOPIC, ONLY, POSE_TOPIC, Protocol, RAW_TOPIC,
    RecordingError, RecordingInfo, SessionSettings, attached, mcap_record, part_path, pose_json,
};
use crate::tracker::{NeedleSensor, ProbeSensor};

/// Longest accepted MCAP record, bytes. A larger length field indicates damage.
const RECORD_LIMIT: usize = 64 << 20;

/// Size of opcode and length before each MCAP record, bytes.
const RECORD_HEAD: u64 = 9;

/// Largest number of damaged parts that are described; all are counted.
const DESCRIBED: usize = 4;

/// Unreadable parts of a recording.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct Damage {
    /// Reason for stopping before the end, with the byte offset; `None` for a complete file.
    pub truncated: Option<String>,
    /// Number of damaged chunks and messages that were skipped.
    pub damaged: u64,
    /// Descriptions of the first damages, each with its byte offset.
    pub damaged_first: Vec<String>,
}

/// Reader of one recording: its messages in order, a chunk at a time.
///
/// The intact parts of a truncated or damaged file are used; [`damage`](Self::damage) reports the rest. Messages of
/// other channels are skipped.
pub struct RecordingReader<R> {
    info: RecordingInfo,
    file: McapFile<R>,
}

/// Splits a file into messages.
struct McapFile<R> {
    source: Counting<R>,
    records: LinearReader,
    path: PathBuf,
    /// Byte offset of the next record.
    offset: u64,
    ended: bool,
    data_ended: bool,
    topics: HashMap<u16, Topic>,
    info: Option<RecordingInfo>,
    settings: Option<SessionSettings>,
    entries: VecDeque<Entry>,
    damage: Damage,
}

#[derive(Clone, Copy, PartialEq)]
enum Topic {
    Raw,
    Event,
    Pose,
    NeedlePose,
}

impl RecordingReader<BufReader<File>> {
    /// Opens the recording at `path`.
    ///
    /// # Errors
    /// The file cannot be opened, or an error of [`from_source`](Self::from_source).
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        match files::open(path, FileKind::Recording) {
            Ok(file) => Self::from_source(BufReader::new(file), path),
            Err(source) => {
                let part = part_path(path);
                if source.kind() == io::ErrorKind::NotFound && part.is_file() {
                    return Err(RecordingError::Unfinished { path: path.to_owned(), part });
                }
                Err(FileError::at("read the recording", path)(source).into())
            }
        }
    }
}

impl<R: Read> RecordingReader<R> {
    /// Reads a recording from `source`; errors name it `path`.
    ///
    /// # Errors
    /// The source cannot be read, isn't MCAP, is compressed, or has no channel of tracker bytes with valid metadata.
    pub fn from_source(source: R, path: &Path) -> Result<Self, RecordingError> {
        let mut file = McapFile::new(source, path);
        while file.info.is_none() && !file.ended {
            file.step()?;
        }
        match file.info.clone() {
            Some(info) => Ok(Self { info, file }),
            None => {
                let first = file.damage.truncated.or_else(|| file.damage.damaged_first.pop());
                let reason = first.unwrap_or_else(|| format!("it has no channel {RAW_TOPIC}"));
                Err(RecordingError::NoTracker { path: file.path, reason })
            }
        }
    }

    /// Description of the recording.
    pub fn info(&self) -> &RecordingInfo {
        &self.info
    }

    /// Unreadable parts so far.
    pub fn damage(&self) -> &Damage {
        &self.file.damage
    }

    /// Settings of the session, if recorded; they precede the first message.
    pub fn settings(&self) -> Option<&SessionSettings> {
        self.file.settings.as_ref()
    }

    /// Next message; `None` at the end of the readable part.
    ///
    /// # Errors
    /// The file cannot be read, or has compressed chunks.
    pub fn next_entry(&mut self) -> Result<Option<Entry>, RecordingError> {
        while self.file.entries.is_empty() && !self.file.ended {
            self.file.step()?;
        }
        Ok(self.file.entries.pop_front())
    }
}

impl<R: Read> McapFile<R> {
    fn new(source: R, path: &Path) -> Self {
        let options = LinearReaderOptions::default().with_emit_chunks(true).with_record_length_limit(RECORD_LIMIT);
        Self {
            source: Counting { inner: source, count: 0 },
            records: LinearReader::new_with_options(options),
            path: path.to_owned(),
            offset: MAGIC.len() as u64,
            ended: false,
            data_ended: false,
            topics: HashMap::new(),
            info: None,
            settings: None,
            entries: VecDeque::new(),
            damage: Damage::default(),
        }
    }

    /// Reads one record of the file.
    fn step(&mut self) -> Result<(), RecordingError> {
        match next_record(&mut self.records, &mut self.source) {
            Ok(Some((opcode, data))) => {
                let offset = self.offset;
                self.offset += RECORD_HEAD + data.len() as u64;
                self.record(offset, opcode, &data)
            }
            Ok(None) => {
                self.ended = true;
                Ok(())
            }
            Err(McapError::Io(source)) => Err(FileError::at("read the recording", &self.path)(source).into()),
            Err(error) => {
                self.ended = true;
                self.cut(&error)
            }
        }
    }

    fn cut(&mut self, error: &McapError) -> Result<(), RecordingError> {
        let (offset, end) = (self.offset, self.source.count);
        if end < offset || (offset == MAGIC.len() as u64 && matches!(error, McapError::BadMagic)) {
            return Err(RecordingError::NotMcap { path: self.path.clone() });
        }
        let what = match error {
            McapError::UnexpectedEof if end == offset => format!("it ends at byte {end}, between two records"),
            McapError::UnexpectedEof => {
                format!("it ends at byte {end}, within the record that starts at byte {offset}")
            }
            other => format!("it is damaged at byte {offset}: {other}"),
        };
        let left = if self.data_ended { "; every message lies before that" } else { "" };
        self.damage.truncated = Some(format!("{what}{left}"));
        Ok(())
    }

    fn record(&mut self, offset: u64, opcode: u8, data: &[u8]) -> Result<(), RecordingError> {
        match opcode {
            op::CHUNK => match chunk(data) {
                Ok(records) => {
                    for (opcode, data) in records {
                        self.inner_record(offset, opcode, &data)?;
                    }
                }
                Err(ChunkError::Compressed(compression)) => {
                    return Err(RecordingError::Compressed { path: self.path.clone(), compression });
                }
                Err(ChunkError::Damaged(reason)) => self.damaged(format!("the chunk at byte {offset}: {reason}")),
            },
            op::DATA_END => self.data_ended = true,
            op::ATTACHMENT => {
                if let Err(reason) = attached::read_attachment(data, &mut self.settings) {
                    self.damaged(format!("the record at byte {offset}: {reason}"));
                }
            }
            op::METADATA => self.metadata(offset, data),
            // Channel records after the end of the data are repetitions.
            _ if !self.data_ended => self.inner_record(offset, opcode, data)?,
            _ => {}
        }
        Ok(())
    }

    fn metadata(&mut self, offset: u64, data: &[u8]) {
        let read = match mcap_record::parse(op::METADATA, data) {
            Ok(Record::Metadata(metadata)) => attached::read_metadata(&metadata, &mut self.settings),
            Ok(_) => Ok(()),
            Err(error) => Err(error),
        };
        if let Err(reason) = read {
            self.damaged(format!("the metadata at byte {offset}: {reason}"));
        }
    }

    /// Handles a record from inside or outside a chunk.
    fn inner_record(&mut self, offset: u64, opcode: u8, data: &[u8]) -> Result<(), RecordingError> {
        if opcode != op::CHANNEL && opcode != op::MESSAGE {
            return Ok(());
        }
        match mcap_record::parse(opcode, data) {
            Ok(Record::Channel(channel)) => return self.channel(channel),
            Ok(Record::Message { header, data }) => self.message(offset, header, &data),
            Ok(_) => {}
            Err(error) => self.damaged(format!("the record at byte {offset}: {error}")),
        }
        Ok(())
    }

    fn channel(&mut self, channel: records::Channel) -> Result<(), RecordingError> {
        if channel.topic == RAW_TOPIC {
            // There is one decoder for one stream: the first raw channel is used, others are skipped.
            if self.info.is_none() {
                self.info = Some(parse_info(&self.path, &channel.metadata)?);
                self.topics.insert(channel.id, Topic::Raw);
            }
        } else if channel.topic == EVENT_TOPIC {
            self.topics.insert(channel.id, Topic::Event);
        } else if channel.topic == POSE_TOPIC && channel.message_encoding == "json" {
            self.topics.insert(channel.id, Topic::Pose);
        } else if channel.topic == NEEDLE_POSE_TOPIC && channel.message_encoding == "json" {
            self.topics.insert(channel.id, Topic::NeedlePose);
        }
        Ok(())
    }

    fn message(&mut self, offset: u64, header: records::MessageHeader, data: &[u8]) {
        #[derive(serde::Deserialize)]
        struct Json {
            name: String,
            value: Option<serde_json::Value>,
        }
        let host_time_ns = header.log_time;
        match self.topics.get(&header.channel_id) {
            Some(Topic::Raw) => self.entries.push_back(Entry::Raw { host_time_ns, bytes: data.to_vec() }),
            Some(Topic::Event) => match serde_json::from_slice::<Json>(data) {
                Ok(Json { name, value }) => {
                    self.entries.push_back(Entry::Event(Event { host_time_ns, name, value }));
                }
                Err(error) => self.damaged(format!("an event in the record at byte {offset}: {error}")),
            },
            Some(topic @ (Topic::Pose | Topic::NeedlePose)) => match pose_json::decode(host_time_ns, data) {
                Ok(pose) if *topic == Topic::Pose => self.entries.push_back(Entry::Pose(pose)),
                Ok(pose) => self.entries.push_back(Entry::NeedlePose(pose)),
                Err(error) => self.damaged(format!("a pose in the record at byte {offset}: {error}")),
            },
            None => {}
        }
    }

    fn damaged(&mut self, what: String) {
        self.damage.damaged += 1;
        if self.damage.damaged_first.len() < DESCRIBED {
            self.damage.damaged_first.push(what);
        }
    }
}

/// Source that counts the bytes read from it.
struct Counting<R> {
    inner: R,
    count: u64,
}

impl<R: Read> Read for Counting<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(buffer)?;
        self.count += read as u64;
        Ok(read)
    }
}

/// Opcode and content of the next record; `None` at the end of the file.
fn next_record(reader: &mut LinearReader, source: &mut impl Read) -> Result<Option<(u8, Vec<u8>)>, McapError> {
    loop {
        match reader.next_event() {
            None => return Ok(None),
            Some(Err(error)) => return Err(error),
            Some(Ok(LinearReadEvent::Record { data, opcode })) => return Ok(Some((opcode, data.to_vec()))),
            Some(Ok(LinearReadEvent::ReadRequest(need))) => {
                let slot = reader.insert(need);
                let read = loop {
                    match source.read(slot) {
                        Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                        other => break other?,
                    }
                };
                reader.notify_read(read);
            }
        }
    }
}

enum ChunkError {
    Compressed(String),
    Damaged(String),
}

/// Opcode and content of every record of a chunk, after checking its checksum.
fn chunk(data: &[u8]) -> Result<Vec<(u8, Vec<u8>)>, ChunkError> {
    let damaged = |error: McapError| ChunkError::Damaged(error.to_string());
    let header = match mcap_record::parse(op::CHUNK, data).map_err(ChunkError::Damaged)? {
        Record::Chunk { header, data: records } => {
            if !header.compression.is_empty() {
                return Err(ChunkError::Compressed(header.compression));
            }
            if header.uncompressed_size != header.compressed_size || records.len() as u64 != header.compressed_size {
                return Err(ChunkError::Damaged("its sizes contradict each other".to_owned()));
            }
            header
        }
        _ => return Err(ChunkError::Damaged("it is no chunk".to_owned())),
    };
    // The header holds three u64, a u32, a string and a u64. All sizes were checked, so nothing may follow the records.
    let header_length = 40 + header.compression.len() as u64;
    if header_length + header.compressed_size != data.len() as u64 {
        return Err(ChunkError::Damaged("bytes follow its records".to_owned()));
    }
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(data.len());
    let mut reader = LinearReader::new_with_options(options);
    let head = [&[op::CHUNK][..], &(data.len() as u64).to_le_bytes()].concat();
    let mut source = head.chain(data);
    let mut records = Vec::new();
    while let Some(record) = next_record(&mut reader, &mut source).map_err(damaged)? {
        records.push(record);
    }
    Ok(records)
}

fn parse_info(path: &Path, metadata: &BTreeMap<String, String>) -> Result<RecordingInfo, RecordingError> {
    let text = |key: &str| metadata.get(key).map(String::as_str);
    let wrong = |key: &'static str, expected: &str| RecordingError::Metadata {
        path: path.to_owned(),
        key,
        found: text(key).map_or_else(|| "missing".to_owned(), |value| format!("`{}`", value.escape_debug())),
        expected: expected.to_owned(),
    };
    let version: Option<u32> = text("format_version").and_then(|v| v.parse().ok());
    if !version.is_some_and(|v| (1..=FORMAT_VERSION).contains(&v)) {
        return Err(wrong("format_version", &format!("in 1..={FORMAT_VERSION}")));
    }
    let protocol = text("protocol").ok_or_else(|| wrong("protocol", "the name of a tracker protocol"))?;
    let protocol: Protocol =
        protocol.parse().map_err(|source| RecordingError::Protocol { path: path.to_owned(), source })?;
    let number = text("sensor").map(|v| v.parse().map_err(|_| wrong("sensor", "in 0..=65535"))).transpose()?;
    let sensor = match (number, text("tool"), text("probe")) {
        (Some(number), ..) => Some(ProbeSensor::Number(number)),
        (None, Some(tool), _) if protocol.has_names() => Some(ProbeSensor::Tool(tool.to_owned())),
        (None, Some(_), _) => return Err(wrong("tool", "absent: sensors of this protocol have numbers")),
        (None, None, Some(ONLY)) => Some(ProbeSensor::Only),
        (None, None, Some(_)) => return Err(wrong("probe", "`only`")),
        (None, None, None) => None,
    };
    let number = text("needle_sensor").map(|v| v.parse().map_err(|_| wrong("needle_sensor", "in 0..=65535")));
    let needle = match (number.transpose()?, text("needle_tool")) {
        (Some(number), _) => Some(NeedleSensor::Number(number)),
        (None, Some(tool)) if protocol.has_names() => Some(NeedleSensor::Tool(tool.to_owned())),
        (None, Some(_)) => return Err(wrong("needle_tool", "absent: sensors of this protocol have numbers")),
        (None, None) => None,
    };
    let start_time_ns = text("start_time_ns").and_then(|v| v.parse().ok());
    Ok(RecordingInfo {
        protocol,
        device: text("device").unwrap_or_default().to_owned(),
        scene: text("scene").unwrap_or_default().to_owned(),
        start_time_ns: start_time_ns.ok_or_else(|| wrong("start_time_ns", "ns since 1970 (UTC)"))?,
        sensor,
        needle,
    })
}
