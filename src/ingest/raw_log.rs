//! The raw log: everything that arrived, durable, in order of arrival; the system of record.
//!
//! One durable transaction a batch. A batch is one value under (mission, spacecraft, batch number); beside it stand an index
//! by channel and count, and the journal of what was told to whom (see `hub::journal`). A repeated frame is kept as a
//! reference to the first copy, told apart by its SHA-256. Every open, decode and write fault is an error with its place.
//! Not here: what the frames mean.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, RwLock};

use redb::{Database, ReadableDatabase, TableDefinition};
use sha2::{Digest, Sha256};

use super::batch;
pub use super::batch::Stored;
use crate::hub::journal;
use crate::hub::told::{self, Told};
use crate::ingest::wire::{Arrival, FrameId, LinkConfig, Verdict};

const BATCHES: TableDefinition<&[u8], &[u8]> = TableDefinition::new("batches");
const FRAMES: TableDefinition<&[u8], (u64, u32)> = TableDefinition::new("frames");
const JOURNAL: TableDefinition<&[u8], &[u8]> = TableDefinition::new("journal");
/// Under the prefix: the number of batches whose changes are in the journal.
const JOURNALED: TableDefinition<&[u8], u64> = TableDefinition::new("journaled");
/// Under the prefix: no message with a larger number was told.
const NUMBERED: TableDefinition<&[u8], u64> = TableDefinition::new("numbered");
/// What was told last of every window, in chunks (see `hub::told`).
const TOLD: TableDefinition<&[u8], &[u8]> = TableDefinition::new("told");

/// The store reads through this much of its own cache; the operating system has more.
const CACHE_OCTETS: usize = 8 << 20;

/// What happened at the dump port, in the order of the log.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// A playback started.
    Opened {
        /// Its number, in order of arrival.
        playback: u32,
    },
    /// A frame was found.
    Arrival {
        /// The playback it is of.
        playback: u32,
        /// The frame and what became of it.
        arrival: Arrival,
    },
    /// A playback ended.
    Closed {
        /// Its number.
        playback: u32,
        /// Bits received of it.
        bits: u64,
    },
}

/// Why the store cannot do what it must.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The directory or the file cannot be used.
    #[error("the store {} cannot be opened: {source}", .path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A read or a write failed.
    #[error("the store {} failed: {source}", .path.display())]
    Access {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The store was filled over another link.
    #[error("the store {} holds frames of {stored} octets (batch {number}), and the configuration has link.frame_octets = {configured}", .path.display())]
    FrameOctets {
        /// The file.
        path: PathBuf,
        /// Number of the batch.
        number: u64,
        /// Octets of a frame there.
        stored: usize,
        /// Octets of a frame by the configuration.
        configured: usize,
    },
    /// A batch does not decode.
    #[error("batch {number} of the store is damaged at octet {offset}: {found}")]
    Damaged {
        /// Its number.
        number: u64,
        /// Where.
        offset: usize,
        /// What stands there.
        found: String,
    },
}

/// Where the first copy of a frame is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Number of the batch.
    pub batch: u64,
    /// Octet in the batch at which the frame's octets begin.
    pub offset: u32,
}

type Digest16 = [u8; 16];

/// The store of one mission and spacecraft.
pub struct RawLog {
    path: PathBuf,
    /// Mission, NUL, spacecraft id: in front of every key.
    prefix: Vec<u8>,
    /// Octets of a frame.
    frame_octets: usize,
    /// None while the file is being opened again after a fault.
    database: RwLock<Option<Database>>,
    /// Batches in the log.
    batches: AtomicU64,
    known: Mutex<HashMap<(FrameId, Digest16), Place>>,
    /// Batches read last, for references.
    recent: Mutex<Vec<(u64, std::sync::Arc<Vec<u8>>)>>,
}

impl RawLog {
    /// Opens or makes the store in a directory; every page of it is held against its checksum first.
    ///
    /// # Errors
    /// When the directory or the file cannot be used, the file was altered since it was written, or another process holds it.
    pub fn open(directory: &Path, mission: &str, link: &LinkConfig) -> Result<Self, StoreError> {
        let path = directory.join("raw.redb");
        let failed = |source| StoreError::Open { path: path.clone(), source };
        std::fs::create_dir_all(directory).map_err(|error| failed(error.into()))?;
        let database = open_database(&path, true).map_err(failed)?;
        let prefix = [mission.as_bytes(), &[0], &link.spacecraft_id.to_be_bytes()].concat();
        Ok(Self {
            path,
            prefix,
            frame_octets: link.frame_octets,
            database: RwLock::new(Some(database)),
            batches: AtomicU64::new(0),
            known: Mutex::default(),
            recent: Mutex::default(),
        })
    }

    fn failed(&self, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> StoreError {
        StoreError::Access { path: self.path.clone(), source: source.into() }
    }

    fn key(&self, tail: &[u8]) -> Vec<u8> {
        [&self.prefix, tail].concat()
    }

    fn with_database<T>(&self, act: impl FnOnce(&Database) -> Result<T, redb::Error>) -> Result<T, StoreError> {
        let held = self.database.read().expect("no holder panics");
        let database = held.as_ref().ok_or_else(|| self.failed("it is being opened again after a fault"))?;
        act(database).map_err(|error| self.failed(error))
    }

    /// Makes a batch durable, with the journal entries that have gathered before it. Entries of several calls never mix: a batch is
    /// either wholly there after a crash or not at all.
    ///
    /// # Errors
    /// When the system refuses; nothing of the batch is there then, and the same batch can be given again.
    pub fn append(&self, number: u64, entries: &[Entry], journal: &JournalPart<'_>) -> Result<(), StoreError> {
        let mut known = self.known.lock().expect("no holder panics");
        let mut fresh: Vec<((FrameId, Digest16), Place)> = Vec::new();
        let mut octets = Vec::with_capacity(entries.len() * 1200);
        for entry in entries {
            let original = match entry {
                Entry::Arrival { arrival: Arrival { verdict: Verdict::Good(id), octets, .. }, .. } => {
                    let digest = Sha256::digest(octets)[..16].try_into().expect("a digest has 32 octets");
                    Some(((*id, digest), known.get(&(*id, digest)).copied()))
                }
                _ => None,
            };
            let place = batch::write(&mut octets, entry, original.and_then(|(_, place)| place));
            if let (Some((key, None)), Some(offset)) = (original, place) {
                let place = Place { batch: number, offset };
                known.insert(key, place);
                fresh.push((key, place));
            }
        }
        let stored = self.with_database(|database| self.commit(database, number, &octets, &fresh, journal));
        if stored.is_ok() && !entries.is_empty() {
            self.batches.store(number + 1, Ordering::Release);
        }
        if stored.is_err() {
            for (key, _) in &fresh {
                known.remove(key);
            }
        }
        stored
    }

    fn commit(
        &self,
        database: &Database,
        number: u64,
        octets: &[u8],
        fresh: &[((FrameId, Digest16), Place)],
        journal: &JournalPart<'_>,
    ) -> Result<(), redb::Error> {
        let transaction = database.begin_write()?;
        {
            if !octets.is_empty() {
                let mut batches = transaction.open_table(BATCHES)?;
                batches.insert(self.key(&number.to_be_bytes()).as_slice(), octets)?;
                let mut frames = transaction.open_table(FRAMES)?;
                for ((id, digest), place) in fresh {
                    let tail = [&[id.channel][..], &id.count.to_be_bytes(), &digest[..4]].concat();
                    frames.insert(self.key(&tail).as_slice(), (place.batch, place.offset))?;
                }
            }
            let mut table = transaction.open_table(JOURNAL)?;
            for entry in journal.entries {
                let key = self.key(&entry.first_seq().to_be_bytes());
                table.insert(key.as_slice(), entry.to_octets().as_slice())?;
            }
            for first_seq in journal.forgotten {
                table.remove(self.key(&first_seq.to_be_bytes()).as_slice())?;
            }
            let mut told = transaction.open_table(TOLD)?;
            for (chunk, octets) in journal.told {
                told.insert(self.key(&chunk_key(*chunk)).as_slice(), octets.as_slice())?;
            }
            transaction.open_table(JOURNALED)?.insert(self.prefix.as_slice(), journal.batches)?;
            transaction.open_table(NUMBERED)?.insert(self.prefix.as_slice(), journal.numbered_through)?;
        }
        transaction.commit()?;
        Ok(())
    }

    /// Closes the file and opens it again: after a refused write nothing else is allowed on it.
    ///
    /// # Errors
    /// When it still cannot be opened.
    pub fn reopen(&self) -> Result<(), StoreError> {
        let mut held = self.database.write().expect("no holder panics");
        *held = None;
        let failed = |source| StoreError::Open { path: self.path.clone(), source };
        *held = Some(open_database(&self.path, false).map_err(failed)?);
        Ok(())
    }

    /// Reads the whole log in order, one batch at a time, and notes which frames are known. Repeats come without their octets: see
    /// [`RawLog::resolve`].
    ///
    /// # Errors
    /// When the file cannot be read, a batch is damaged, or frames are of another length; what came before has been handed on. And what
    /// `hand_on` says.
    pub fn replay(
        &self,
        mut hand_on: impl FnMut(u64, Vec<Stored>) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let mut number = 0;
        while let Some(entries) = self.stored_batch(number)? {
            for stored in &entries {
                if let Stored::Entry(
                    Entry::Arrival { arrival: Arrival { verdict: Verdict::Good(id), octets, .. }, .. },
                    offset,
                ) = stored
                {
                    self.of_our_length(number, octets)?;
                    let digest = Sha256::digest(octets)[..16].try_into().expect("a digest has 32 octets");
                    let place = Place { batch: number, offset: *offset };
                    self.known.lock().expect("no holder panics").insert((*id, digest), place);
                }
            }
            hand_on(number, entries)?;
            number += 1;
            self.batches.fetch_max(number, Ordering::Release);
        }
        Ok(())
    }

    fn of_our_length(&self, number: u64, frame: &[u8]) -> Result<(), StoreError> {
        if frame.len() == self.frame_octets {
            return Ok(());
        }
        let (path, configured) = (self.path.clone(), self.frame_octets);
        Err(StoreError::FrameOctets { path, number, stored: frame.len(), configured })
    }

    /// The entries of a batch that hold a frame for the first time, or a refused one; repeats left out.
    ///
    /// # Errors
    /// When the file cannot be read or the batch is damaged.
    pub fn first_arrivals(&self, number: u64) -> Result<Vec<(u32, Arrival)>, StoreError> {
        let stored = self.stored_batch(number)?.unwrap_or_default();
        let arrivals = stored.into_iter().filter_map(|stored| match stored {
            Stored::Entry(Entry::Arrival { playback, arrival }, _) => Some((playback, arrival)),
            _ => None,
        });
        Ok(arrivals.collect())
    }

    /// Whether the file has nothing of this mission and spacecraft, replayed or not.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn is_empty(&self) -> Result<bool, StoreError> {
        Ok(self.batch_octets(0)?.is_none())
    }

    /// Batches known to be durable: those appended, and of those that were there when it was opened the ones replayed.
    pub fn batches(&self) -> u64 {
        self.batches.load(Ordering::Acquire)
    }

    /// Of whom the store holds frames, in words: one store may serve several missions and spacecraft.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn held_for(&self) -> Result<Vec<String>, StoreError> {
        self.with_database(|database| {
            let transaction = database.begin_read()?;
            let mut held = Vec::new();
            let Some(table) = existing(transaction.open_table(BATCHES))? else { return Ok(held) };
            let mut from = Vec::new();
            while let Some(row) = table.range(from.as_slice()..)?.next() {
                let key = row?.0.value().to_vec();
                let prefix = &key[..key.len().saturating_sub(size_of::<u64>())];
                held.extend(owner_of_prefix(prefix));
                from = [prefix, &[0xff; size_of::<u64>() + 1]].concat();
            }
            Ok(held)
        })
    }

    fn batch_octets(&self, number: u64) -> Result<Option<Vec<u8>>, StoreError> {
        let key = self.key(&number.to_be_bytes());
        self.with_database(|database| {
            let transaction = database.begin_read()?;
            match existing(transaction.open_table(BATCHES))? {
                Some(table) => Ok(table.get(key.as_slice())?.map(|guard| guard.value().to_vec())),
                None => Ok(None),
            }
        })
    }

    fn stored_batch(&self, number: u64) -> Result<Option<Vec<Stored>>, StoreError> {
        match self.batch_octets(number)? {
            None => Ok(None),
            Some(octets) => {
                batch::read(&octets).map(Some).map_err(|(offset, found)| StoreError::Damaged { number, offset, found })
            }
        }
    }

    /// A repeated arrival with its octets, from the first copy.
    ///
    /// # Errors
    /// When the file cannot be read, or the first copy is not where it should be.
    pub fn resolve(&self, mut arrival: Arrival, place: Place) -> Result<Arrival, StoreError> {
        let octets = self.recent_batch(place.batch)?;
        let damaged = || StoreError::Damaged {
            number: place.batch,
            offset: place.offset as usize,
            found: "a repeat refers to it, and no frame begins there".into(),
        };
        arrival.octets = batch::frame_at(&octets, place.offset).ok_or_else(damaged)?.to_vec();
        Ok(arrival)
    }

    fn recent_batch(&self, number: u64) -> Result<std::sync::Arc<Vec<u8>>, StoreError> {
        /// Repeats come in the order of their first copies, so few batches are needed at once.
        const KEPT: usize = 4;
        let mut recent = self.recent.lock().expect("no holder panics");
        if let Some((_, octets)) = recent.iter().find(|(kept, _)| *kept == number) {
            return Ok(octets.clone());
        }
        let octets = std::sync::Arc::new(self.batch_octets(number)?.unwrap_or_default());
        if recent.len() == KEPT {
            recent.remove(0);
        }
        recent.push((number, octets.clone()));
        Ok(octets)
    }

    /// What was told in earlier runs.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn journal(&self) -> Result<Journal, StoreError> {
        let from = self.prefix.clone();
        let to = self.key(&[0xff; 9]);
        self.with_database(|database| {
            let transaction = database.begin_read()?;
            let mut journal = Journal::default();
            if let Some(table) = existing(transaction.open_table(JOURNAL))? {
                for row in table.range(from.as_slice()..to.as_slice())? {
                    journal.entries.extend(journal::Entry::from_octets(row?.1.value()));
                }
            }
            if let Some(table) = existing(transaction.open_table(TOLD))? {
                for row in table.range(from.as_slice()..to.as_slice())? {
                    let (key, octets) = row?;
                    if let Some(chunk) = chunk_of_key(&key.value()[self.prefix.len()..]) {
                        journal.told.extend(told::from_octets(chunk, octets.value()));
                    }
                }
            }
            let number = |table| -> Result<u64, redb::Error> {
                match existing(transaction.open_table(table))? {
                    Some(table) => Ok(table.get(self.prefix.as_slice())?.map_or(0, |guard| guard.value())),
                    None => Ok(0),
                }
            };
            journal.batches = number(JOURNALED)?;
            journal.numbered_through = number(NUMBERED)?;
            Ok(journal)
        })
    }
}

/// The mission and the spacecraft of a prefix, in words.
fn owner_of_prefix(prefix: &[u8]) -> Option<String> {
    let mission = prefix.split(|octet| *octet == 0).next()?;
    let spacecraft = prefix.get(mission.len() + 1..)?.iter().fold(0_u64, |id, octet| id << 8 | u64::from(*octet));
    Some(format!("mission {:?}, spacecraft {spacecraft:#x}", String::from_utf8_lossy(mission)))
}

/// A table, where anything was ever written to it.
fn existing<T>(opened: Result<T, redb::TableError>) -> Result<Option<T>, redb::Error> {
    match opened {
        Ok(table) => Ok(Some(table)),
        Err(redb::TableError::TableDoesNotExist(_)) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// The key of a chunk, in order of time also before clock 0.
fn chunk_key(chunk: i64) -> [u8; 8] {
    (chunk as u64 ^ 1 << 63).to_be_bytes()
}

fn chunk_of_key(key: &[u8]) -> Option<i64> {
    key.try_into().ok().map(|octets| (u64::from_be_bytes(octets) ^ 1 << 63) as i64)
}

/// What was told in earlier runs.
#[derive(Debug, Default)]
pub struct Journal {
    /// Messages, in order.
    pub entries: Vec<journal::Entry>,
    /// What was told last of every window.
    pub told: Vec<Told>,
    /// Batches whose changes are in it.
    pub batches: u64,
    /// No message with a larger number was told.
    pub numbered_through: u64,
}

/// What a commit adds to the journal.
#[derive(Debug, Clone, Copy)]
pub struct JournalPart<'a> {
    /// New entries.
    pub entries: &'a [journal::Entry],
    /// First numbers of entries that fell out of the journal's bound.
    pub forgotten: &'a [u64],
    /// Chunks of what was told last of every window.
    pub told: &'a [(i64, Vec<u8>)],
    /// Until the next commit no message with a larger number is told.
    pub numbered_through: u64,
    /// Batches whose changes are in the journal once these entries are.
    pub batches: u64,
}

fn open_database(path: &Path, checked: bool) -> Result<Database, Box<dyn std::error::Error + Send + Sync>> {
    Ok(Database::builder().set_cache_size(CACHE_OCTETS).set_check_integrity_on_open(checked).create(path)?)
}
