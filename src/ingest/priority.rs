//! Who gives way when every processor is busy: those who ask are answered first, then products are made, then searched for what a
//! simulation left out.

/// Niceness of what makes products: decoding, the writer, the recording. A tenth of the weight of those who ask, who are few and brief;
/// enough to go on beside a machine that is busy otherwise.
pub const PRODUCTS_GIVE_WAY: i32 = 10;
/// Niceness of the searches of the running diagnosis: two thirds of the weight of products, so that on a busy machine they too go on.
pub const SEARCHES_GIVE_WAY: i32 = 12;

/// Lowers the priority of this thread to a niceness. Where the system has no priority of single threads, all stay equal.
#[cfg(target_os = "linux")]
pub fn give_way(niceness: i32) {
    if let Err(error) = rustix::process::setpriority_process(None, niceness) {
        tracing::debug!(%error, niceness, "a thread keeps its priority");
    }
}

/// Lowers the priority of this thread to a niceness. Where the system has no priority of single threads, all stay equal.
#[cfg(not(target_os = "linux"))]
pub fn give_way(_niceness: i32) {}
