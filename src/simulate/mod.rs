//! A mission, its forces, the instrument, and the recorder dump that comes down.
