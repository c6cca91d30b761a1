//! Bytes in, facts out, and back: sync marker, channel coding, transfer frame, space packet, record.
//!
//! Pure: no socket, file or clock. Every reader here has its writer beside it, which the simulator and the tests use.
//! Deliberately not here: what the facts mean (see `pipeline`), and where bytes come from (see `ingest::listener`).

pub mod assembly;
pub mod coding;
pub mod frame;
pub mod packet;
pub mod pad;
pub mod playback;
pub mod record;
pub mod sync;

pub use assembly::{Assembled, Assembler, Placement};
pub use coding::LinkConfig;
pub use frame::{FrameId, FrameRefusal, TransferFrame};
pub use packet::{Apid, PacketId, PacketRefusal, SpacePacket};
pub use pad::{Pad, PadError, PadHeader, PadSample};
pub use playback::{PlaybackPart, PlaybackReader};
pub use record::Record;
pub use sync::{Arrival, Deframer, Direction, Polarity, Sense, Verdict};
