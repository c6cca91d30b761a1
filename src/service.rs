//! The service, wired together from start to drain.
