//! Work shared between processors: the one place where the core does so.
//!
//! What is shared are pure functions, and results come in the order of what they are of: the same bytes, however many processors there
//! are and whichever is done first.

use rayon::prelude::*;

/// The results of two functions.
pub fn both<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    rayon::join(a, b)
}

/// The result of each item, in their order.
pub fn map<'a, T: Sync, U: Send>(items: &'a [T], of: impl Fn(&'a T) -> U + Sync + Send) -> Vec<U> {
    items.par_iter().with_max_len(1).map(of).collect()
}

/// The result of each index below `n`, in their order, where one is little work.
pub fn map_range<U: Send>(n: usize, of: impl Fn(usize) -> U + Sync + Send) -> Vec<U> {
    (0..n).into_par_iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_the_order_of_the_items() {
        let items: Vec<u64> = (0..10_000).collect();
        let squares = map(&items, |n| n * n);
        assert!(items.iter().zip(&squares).all(|(n, square)| n * n == *square));
        assert_eq!(map_range(items.len(), |n| items[n] * items[n]), squares);
        assert_eq!(both(|| squares.len(), || "b"), (10_000, "b"));
    }
}
