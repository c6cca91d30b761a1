//! One MCAP file being written: raw frames and products as JSON with schemas, in compressed, indexed chunks.
//!
//! Times of messages are mission times (UTC), not those of arrival, so that a viewer shows the flight.

use std::collections::BTreeSet;
use std::io::{Seek, Write};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use mcap::records::MessageHeader;
use mcap::{McapResult, WriteOptions, Writer};

use super::frame_time::frame_clock;
use super::schema::{TOPICS, json_schema};
use crate::hub::wire::{passing_members, told_anomaly, told_calibration, told_event};
use crate::hub::{Body, Message, Topic};
use crate::ingest::wire::{Arrival, LinkConfig, Verdict};
use crate::pipeline::calibration::Calibration;
use crate::pipeline::{Settings, Station};
use crate::units::{Clock, MissionTime};

/// The topic of raw frames.
pub const FRAME_TOPIC: &str = "/raw/frame";
/// Compressed together: large enough for a good ratio, small enough to seek in.
const CHUNK_OCTETS: u64 = 1 << 20;
/// The lowest level: a recording must keep up with a playback at full speed.
const COMPRESSION_LEVEL: u32 = 1;

/// A recording being written.
pub struct Recording<W: Write + Seek> {
    writer: Writer<W>,
    channels: Vec<u16>,
    sequence: u32,
    link: LinkConfig,
    mission: MissionTime,
    /// Time of the last frame whose time is known: refused frames have none of their own.
    last_frame: Clock,
    text: String,
}

impl<W: Write + Seek> Recording<W> {
    /// Begins a recording: schemas and channels.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn begin(out: W, settings: &Settings) -> McapResult<Self> {
        let options = WriteOptions::new()
            .chunk_size(Some(CHUNK_OCTETS))
            .compression_level(COMPRESSION_LEVEL)
            .compression_threads(0)
            .library(concat!("oare-ground/", env!("CARGO_PKG_VERSION")));
        let mut writer = options.create(out)?;
        let mut channels = Vec::new();
        for (topic, name, members) in TOPICS {
            let schema = writer.add_schema(name, "jsonschema", &json_schema(name, members))?;
            let metadata = [
                ("mission".to_string(), settings.mission.clone()),
                ("spacecraft_id".to_string(), settings.link.spacecraft_id.to_string()),
            ];
            channels.push(writer.add_channel(schema, topic, "json", &metadata.into())?);
        }
        let last_frame = Clock::from_tenths(0);
        let (link, mission) = (settings.link, settings.time);
        Ok(Self { writer, channels, sequence: 0, link, mission, last_frame, text: String::new() })
    }

    /// Records a frame as it came.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn frame(&mut self, playback: u32, arrival: &Arrival) -> McapResult<()> {
        use std::fmt::Write as _;
        let (verdict, id) = match arrival.verdict {
            Verdict::Good(id) => ("good", Some(id)),
            Verdict::Refused(refusal) => (refusal.word(), None),
        };
        let clock = id.and_then(|_| frame_clock(&self.link, &arrival.octets));
        self.last_frame = clock.unwrap_or(self.last_frame);
        let mut text = std::mem::take(&mut self.text);
        text.clear();
        let (direction, polarity) = (arrival.sense.direction_word(), arrival.sense.polarity_word());
        let null = || "null".to_string();
        let _ = write!(
            text,
            r#"{{"playback":{playback},"direction":"{direction}","polarity":"{polarity}","first_bit":{},"verdict":"{verdict}","channel":{},"count":{},"clock_s":{},"octets":""#,
            arrival.first_bit,
            id.map_or_else(null, |id| id.channel.to_string()),
            id.map_or_else(null, |id| id.count.to_string()),
            clock.map_or_else(null, |clock| clock.seconds().to_string()),
        );
        STANDARD.encode_string(&arrival.octets, &mut text);
        text.push_str("\"}");
        let written = self.write(0, self.last_frame, text.as_bytes());
        self.text = text;
        written
    }

    /// Records a message of the hub; raw samples are left out, for the frames hold them.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn message(&mut self, message: &Message) -> McapResult<()> {
        let (channel, clock) = match &message.body {
            Body::Second(_) => return Ok(()),
            Body::Window(product) | Body::Supersede(product, _) => (1, product.start),
            Body::Withdrawn { start, .. } => (1, *start),
            Body::Told { topic, clock, .. } => (channel_of(*topic), *clock),
        };
        let mission = self.mission;
        let members = passing_members(&mission, message);
        let mut text = Vec::with_capacity(members.len() + 2);
        text.push(b'{');
        text.extend_from_slice(&members);
        text.push(b'}');
        self.write(channel, clock, &text)
    }

    fn write(&mut self, channel: usize, clock: Clock, data: &[u8]) -> McapResult<()> {
        let time_ns = u64::try_from(self.mission.utc(clock.seconds()).as_nanosecond()).unwrap_or(0);
        self.sequence = self.sequence.wrapping_add(1);
        let header = MessageHeader {
            channel_id: self.channels[channel],
            sequence: self.sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.writer.write_to_known_channel(&header, data)
    }

    /// Writes everything but raw seconds that a station has of a span: windows, versions of the calibration that were new in it or that its
    /// windows are made with, events, and anomalies that reach into it.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn products(&mut self, station: &Station, from: Clock, to: Clock) -> McapResult<()> {
        let (mission, derived) = (self.mission, station.derived());
        let between = |clock: Clock| (from..=to).contains(&clock);
        let windows = || station.products().filter(|product| between(product.start));
        let made_with: BTreeSet<u32> = windows().map(|product| product.calibration).collect();
        let is_wanted = |version: &&Calibration| between(version.known_since) || made_with.contains(&version.version);
        let versions = derived.timeline.iter().filter(is_wanted);
        let events = station.events().filter(|event| between(event.clock));
        let anomalies = derived.anomalies.iter().filter(|anomaly| anomaly.from <= to && from <= anomaly.to);
        let bodies = windows()
            .map(|product| Body::Window((*product).into()))
            .chain(versions.map(told_calibration))
            .chain(events.map(|event| told_event(&mission, event)))
            .chain(anomalies.map(|anomaly| told_anomaly(&mission, anomaly)));
        for (seq, body) in (1..).zip(bodies) {
            self.message(&Message::new(seq, body))?;
        }
        Ok(())
    }

    /// Writes the index and hands the file back.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn finish(mut self) -> McapResult<W> {
        self.writer.finish()?;
        Ok(self.writer.into_inner())
    }
}

fn channel_of(topic: Topic) -> usize {
    match topic {
        Topic::Raw => 0,
        Topic::Window => 1,
        Topic::Calibration => 2,
        Topic::Event => 3,
        Topic::Anomaly => 4,
        Topic::Diagnosis => 5,
    }
}
