//! Bytes in, facts out, and back: sync marker, transfer frame, space packet, record.
