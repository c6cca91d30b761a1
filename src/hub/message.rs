//! What is told to readers: numbered messages on topics.

use std::sync::{Arc, OnceLock};

use bytes::Bytes;

use crate::pipeline::product::{Product, Revision};
use crate::telemetry::AccRecord;
use crate::units::Clock;

/// What a reader can choose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Topic {
    /// Windows, their later revisions, gaps.
    Window,
    /// Raw samples, a second each.
    Raw,
    /// New versions of the calibration.
    Calibration,
    /// Events of the instrument.
    Event,
    /// What the ground found odd.
    Anomaly,
    /// Diagnoses.
    Diagnosis,
}

impl Topic {
    /// All, in the order of their codes.
    pub const ALL: [Topic; 6] =
        [Topic::Window, Topic::Raw, Topic::Calibration, Topic::Event, Topic::Anomaly, Topic::Diagnosis];

    /// The word for it.
    pub const fn word(self) -> &'static str {
        ["window", "raw", "calibration", "event", "anomaly", "diagnosis"][self as usize]
    }
}

/// A choice of topics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Topics(u8);

impl Topics {
    /// Every topic.
    pub const ALL: Topics = Topics(0b11_1111);
    /// None yet.
    pub const NONE: Topics = Topics(0);

    /// This choice and one topic more.
    pub const fn with(self, topic: Topic) -> Topics {
        Topics(self.0 | 1 << topic as u8)
    }

    /// This choice but for one topic.
    pub const fn without(self, topic: Topic) -> Topics {
        Topics(self.0 & !(1 << topic as u8))
    }

    /// Whether a topic is chosen.
    pub const fn has(self, topic: Topic) -> bool {
        self.0 & (1 << topic as u8) != 0
    }

    /// The chosen ones.
    pub fn iter(self) -> impl Iterator<Item = Topic> {
        Topic::ALL.into_iter().filter(move |topic| self.has(*topic))
    }

    /// From words with commas between; the word that is none.
    pub fn from_words(words: &str) -> Result<Self, String> {
        let mut topics = Topics::NONE;
        for word in words.split(',').map(str::trim).filter(|word| !word.is_empty()) {
            match Topic::ALL.into_iter().find(|topic| topic.word() == word) {
                Some(topic) => topics = topics.with(topic),
                None => return Err(word.into()),
            }
        }
        Ok(topics)
    }
}

/// What a message says.
#[derive(Debug, Clone, PartialEq)]
pub enum Body {
    /// A window, for the first time.
    Window(Arc<Product>),
    /// A later revision of a window.
    Supersede(Arc<Product>, Option<Revision>),
    /// A window that was told of and that there is no longer: the frames it was made from have lost a vote.
    Withdrawn {
        /// Where it began.
        start: Clock,
        /// The JSON members, `"type"` first.
        json: String,
    },
    /// One second of raw samples.
    Second(Box<AccRecord>),
    /// Anything else, in its JSON members, `"type"` first.
    Told {
        /// Its topic.
        topic: Topic,
        /// The instrument clock it is about.
        clock: Clock,
        /// Its JSON members.
        json: String,
    },
}

impl Body {
    /// Start of the window it is about.
    pub fn window_start(&self) -> Option<Clock> {
        match self {
            Body::Window(product) | Body::Supersede(product, _) => Some(product.start),
            Body::Withdrawn { start, .. } => Some(*start),
            Body::Second(_) | Body::Told { .. } => None,
        }
    }

    /// The topic it is told on.
    pub fn topic(&self) -> Topic {
        match self {
            Body::Window(_) | Body::Supersede(..) | Body::Withdrawn { .. } => Topic::Window,
            Body::Second(_) => Topic::Raw,
            Body::Told { topic, .. } => *topic,
        }
    }
}

/// A numbered message.
#[derive(Debug)]
pub struct Message {
    /// Its number, of all topics together.
    pub seq: u64,
    /// What it says.
    pub body: Body,
    /// Its JSON members, made by the first reader that needs them and shared by all.
    pub text: OnceLock<Bytes>,
    /// The whole text for readers whose message before it was this one: all readers of the same topics share it.
    pub whole: OnceLock<(u64, Bytes)>,
}

impl Message {
    /// A message that nobody has read yet.
    pub fn new(seq: u64, body: Body) -> Self {
        Self { seq, body, text: OnceLock::new(), whole: OnceLock::new() }
    }
}
