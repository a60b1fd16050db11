//! Session settings as records of an MCAP file.

use std::borrow::Cow;
use std::collections::BTreeMap;

use mcap::records::Metadata;

use super::{SETTINGS_NAME, STATION_NAME, SessionSettings};

/// Settings as a metadata record.
pub(super) fn metadata(settings: &SessionSettings) -> Metadata {
    let text = |key: &str, value: &str| (key.to_owned(), value.to_owned());
    let metadata = BTreeMap::from([
        text("version", &settings.version),
        text("seed", &settings.seed.to_string()),
        text("adapter", &settings.adapter),
        text("station_path", &settings.station_path),
    ]);
    Metadata { name: SETTINGS_NAME.to_owned(), metadata }
}

/// Station file as an attachment.
pub(super) fn station(settings: &SessionSettings, time_ns: u64) -> mcap::Attachment<'_> {
    mcap::Attachment {
        log_time: time_ns,
        create_time: time_ns,
        name: STATION_NAME.to_owned(),
        media_type: "application/toml".to_owned(),
        data: Cow::Borrowed(settings.station.as_bytes()),
    }
}

/// Reads the metadata record into `settings`; a record with another name is ignored.
pub(super) fn read_metadata(record: &Metadata, settings: &mut Option<SessionSettings>) -> Result<(), String> {
    if record.name != SETTINGS_NAME {
        return Ok(());
    }
    let text = |key: &str| record.metadata.get(key).cloned().unwrap_or_default();
    let seed = text("seed");
    let seed =
        seed.parse().map_err(|_| format!("`seed` is `{}`; it must be in 0..=4294967295", seed.escape_debug()))?;
    let station = settings.take().map(|s| s.station).unwrap_or_default();
    *settings = Some(SessionSettings {
        version: text("version"),
        seed,
        adapter: text("adapter"),
        station_path: text("station_path"),
        station,
    });
    Ok(())
}

/// Reads the attachment record `content` into `settings`; a record with another name is ignored.
///
/// The record is parsed here because the parser of the mcap crate (0.26) panics on a truncated one.
pub(super) fn read_attachment(content: &[u8], settings: &mut Option<SessionSettings>) -> Result<(), String> {
    let short = || format!("an attachment of {} bytes ends early", content.len());
    let (body, checksum) = content.split_last_chunk::<4>().ok_or_else(short)?;
    let mut left = body.get(16..).ok_or_else(short)?;
    let name = text(&mut left).ok_or_else(short)?;
    let _media_type = text(&mut left).ok_or_else(short)?;
    let (length, data) = left.split_first_chunk::<8>().ok_or_else(short)?;
    if u64::from_le_bytes(*length) != data.len() as u64 {
        return Err(format!(
            "an attachment says that it has {} bytes, and has {}",
            u64::from_le_bytes(*length),
            data.len()
        ));
    }
    if name != STATION_NAME.as_bytes() {
        return Ok(());
    }
    let found = u32::from_le_bytes(*checksum);
    let computed = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(body);
    // 0 means that there is no checksum.
    if found != 0 && found != computed {
        return Err(format!("{STATION_NAME} has the checksum {found:08x}, but its bytes give {computed:08x}"));
    }
    let text = std::str::from_utf8(data).map_err(|error| format!("{STATION_NAME}: {error}"))?;
    settings.get_or_insert_default().station = text.to_owned();
    Ok(())
}

/// Takes a length-prefixed string from the front of `left`; `None` if it is incomplete.
fn text<'a>(left: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, behind) = left.split_first_chunk::<4>()?;
    let (text, behind) = behind.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)?;
    *left = behind;
    Some(text)
}
