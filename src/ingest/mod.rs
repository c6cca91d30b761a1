//! From the socket to the durable raw log. The byte decoding proper is in [`wire`] and pure.

pub mod wire;
