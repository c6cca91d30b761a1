//! Our recordings, read again: the frames as a dump, to be processed or replayed.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;

use super::RecordError;
use super::mcap_file::FRAME_TOPIC;
use crate::ingest::wire::LinkConfig;
use crate::ingest::wire::coding::{SYNC_MARKER, encode};

/// Whether octets begin as an MCAP file does.
pub fn is_mcap(octets: &[u8]) -> bool {
    octets.starts_with(mcap::MAGIC)
}

#[derive(Deserialize)]
struct FrameMessage<'a> {
    #[serde(borrow)]
    verdict: std::borrow::Cow<'a, str>,
    #[serde(borrow)]
    octets: std::borrow::Cow<'a, str>,
}

/// What a recording holds.
#[derive(Debug)]
pub struct Recorded {
    /// Its frames as a dump.
    pub dump: Vec<u8>,
    /// Why there may have been more: the file is cut off or damaged.
    pub faults: Vec<String>,
}

/// The frames of a recording as one forward dump: each behind a sync marker, refused ones too where they are whole. A recording cut
/// off by a crash is read as far as it goes, and messages that cannot be read are left out.
///
/// Frames stand in a recording without their channel coding; the dump has that of `link`.
///
/// # Errors
/// When the octets are no MCAP, or no recording of ours.
pub fn dump(octets: &[u8], link: &LinkConfig) -> Result<Recorded, RecordError> {
    let options = enumset::EnumSet::only(mcap::read::Options::IgnoreEndMagic);
    let messages = mcap::MessageStream::new_with_options(octets, options).map_err(RecordError::Read)?;
    let mut dump = Vec::new();
    let mut frames = 0u64;
    let mut unread = Vec::new();
    let mut cut_off = (!octets.ends_with(mcap::MAGIC)).then(|| "its end is missing".to_owned());
    for message in messages {
        let message = match message {
            Ok(message) => message,
            Err(error) if frames > 0 => {
                cut_off = Some(error.to_string());
                break;
            }
            Err(error) => return Err(RecordError::Read(error)),
        };
        if message.channel.topic != FRAME_TOPIC {
            continue;
        }
        match frame(&message) {
            Ok((verdict, octets)) => {
                frames += 1;
                if verdict != "truncated" {
                    dump.extend(SYNC_MARKER.to_be_bytes());
                    // What could not be decoded is kept as it came.
                    let as_sent = if octets.len() == link.frame_octets { encode(link, &octets) } else { octets };
                    dump.extend(as_sent);
                }
            }
            Err(error) => unread.push(error),
        }
    }
    let faults = [
        unread.first().map(|first| format!("{} frames of it cannot be read, the first: {first}", unread.len())),
        cut_off.map(|why| format!("{frames} frames are read of it and no more: {why}")),
    ];
    match unread.into_iter().next() {
        Some(first) if frames == 0 => Err(first),
        None if frames == 0 => Err(RecordError::NoFrames { expected: FRAME_TOPIC }),
        _ => Ok(Recorded { dump, faults: faults.into_iter().flatten().collect() }),
    }
}

/// The verdict and the octets of one frame.
fn frame(message: &mcap::Message<'_>) -> Result<(String, Vec<u8>), RecordError> {
    let refuse = |found: String| RecordError::Frame { topic: FRAME_TOPIC, sequence: message.sequence, found };
    let frame: FrameMessage<'_> = serde_json::from_slice(&message.data).map_err(|error| refuse(error.to_string()))?;
    let octets = STANDARD.decode(frame.octets.as_bytes()).map_err(|error| refuse(error.to_string()))?;
    Ok((frame.verdict.into_owned(), octets))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::io::Cursor;

    use super::*;

    /// A recording with these messages in place of frames.
    fn recording(messages: &[&str]) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let mut writer = mcap::Writer::new(&mut file).unwrap();
        let channel_id = writer.add_channel(0, FRAME_TOPIC, "json", &BTreeMap::new()).unwrap();
        for (sequence, message) in (0..).zip(messages) {
            let header = mcap::records::MessageHeader { channel_id, sequence, log_time: 0, publish_time: 0 };
            writer.write_to_known_channel(&header, message.as_bytes()).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        file.into_inner()
    }

    #[test]
    fn a_message_that_cannot_be_read_is_left_out_and_told() {
        let good = r#"{"verdict":"fecf","octets":"AQID"}"#;
        let link = LinkConfig::default();
        let whole = dump(&recording(&[good, good]), &link).unwrap();
        assert_eq!((whole.dump.len(), whole.faults.len()), (14, 0));
        let part = dump(&recording(&[good, r#"{"verdict":"fecf","octets":"A!ID"}"#, "{", good]), &link).unwrap();
        assert_eq!((part.dump, part.faults.len()), (whole.dump, 1));
        assert!(part.faults[0].starts_with("2 frames of it cannot be read, the first: "), "{:?}", part.faults);
        assert!(dump(&recording(&["{"]), &link).is_err() && dump(&recording(&[]), &link).is_err());
    }
}
