//! From the socket to the durable raw log and the products. The byte decoding proper is in [`wire`] and pure.

mod batch;
pub mod listener;
pub mod log_replay;
pub mod priority;
pub mod raw_log;
pub mod wire;
pub mod writer;
