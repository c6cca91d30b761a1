//! MCAP and table files out.
