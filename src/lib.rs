//! # oare-ground
//!
//! The ground station of the Orbital Acceleration Research Experiment (OARE): payload-recorder dumps in at a
//! TCP port, quasi-steady acceleration of the Orbiter in body axes out, every frame accounted for, every value with a
//! standard error, and, where a simulation and the recording differ, what physics the simulation left out.
//!
//! ## Bird's eye
//!
//! ```text
//!  TCP bytes -> sync -> frame -> [durable raw log] -> packet -> record -> window -> calibrated window -> body sample
//!              ingest::wire        ingest::raw_log    ingest::wire  pipeline (counts) pipeline (ng)        |
//!                                                                                                          v
//!                                                        hub -> api (HTTP, WebSocket), record (MCAP, CSV), diagnose
//! ```
//!
//! ## Code map, in reading order; each room uses only rooms named before it
//!
//! | room | what it holds | pure |
//! |---|---|---|
//! | [`units`] | clock, mission time, constants: SI inside, conversions at the borders | yes |
//! | [`math`] | robust means, least squares, rotation, spectra: slices and matrices only | yes |
//! | [`paper`] | what every report shares: page, tables, figures | yes |
//! | [`telemetry`] | the nouns: records, axes, ranges, quality | yes |
//! | [`ingest::wire`] | bytes to frames, packets and records, and back | yes |
//! | [`physics`] | orbit, attitude, atmosphere, Sun, geomagnetic and gravity field; one force term a file | yes |
//! | [`pipeline`] | range, window, bias, scale, axes; the calibration models | yes |
//! | [`simulate`] | a mission, its forces, the instrument and the recorder dump | yes |
//! | [`diagnose`] | a recording against its simulation: noise, locate, name, model, show | yes |
//! | [`challenge`] | concealed cases: made, sealed, analysed blind, revealed, scored | no |
//! | [`config`] | configuration files, raw and checked | no |
//! | [`hub`] | the one seam between producers and consumers of products | no |
//! | [`ingest`] (listener, raw log), [`record`], [`api`] | the shell: sockets, files | no |
//! | [`service`] | wires the shell together, from start to drain | no |
//!
//! ## Invariants, most of them absences
//!
//! - A pure room never reads a clock, opens a socket or a file, starts a thread or knows a runtime; time and seeds are
//!   arguments. Work on many items is shared between processors in one place, `math::shared_work`, in an order that does not
//!   show. `tests/it/layering.rs` keeps this and the order of the rooms.
//! - Nothing counts a frame that is not durable in the raw log; every product is a function of the *set* of frames,
//!   the configuration and the calibration policy. Arrival order, chunking and repeats change nothing.
//! - Frames in = frames new + frames repeated + frames refused, by reason.
//! - No uncalibrated window can be rotated into body axes: the types do not allow it.
//! - Every queue is bounded, and what overflows is counted and told to whom it concerns.

/// A search takes and gives back hundreds of megabytes of series that live for a moment: the usual allocator returns them to the system,
/// which then has to clear every page of them again, a fifth of the time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

pub mod api;
pub mod challenge;
pub mod config;
pub mod diagnose;
pub mod hub;
pub mod ingest;
pub mod math;
pub mod paper;
pub mod physics;
pub mod pipeline;
pub mod record;
pub mod service;
pub mod simulate;
pub mod telemetry;
pub mod units;
