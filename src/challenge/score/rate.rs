//! A share with its 95 % interval.

use serde::Serialize;

/// Cases named with a rate, at most.
const NAMED_MAX: usize = 40;

/// So many of so many.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rate {
    /// What is counted.
    pub name: String,
    /// What it should be.
    pub aim: String,
    /// Cases that count.
    pub hits: usize,
    /// Cases in all.
    pub of: usize,
    /// 95 % interval (Wilson).
    pub interval: [f64; 2],
    /// The minority: the cases to look at, those that hit when few do, else those that do not.
    pub look_at: Vec<String>,
}

impl Rate {
    /// Counts hits over items.
    pub fn over<'a, T: 'a>(
        name: &str,
        aim: &str,
        items: impl Iterator<Item = &'a T>,
        hit: &dyn Fn(&T) -> bool,
        id: impl Fn(&T) -> String,
    ) -> Self {
        let (mut hits, mut misses) = (Vec::new(), Vec::new());
        for item in items {
            if hit(item) { hits.push(id(item)) } else { misses.push(id(item)) }
        }
        let (count, of) = (hits.len(), hits.len() + misses.len());
        // An aim that begins with "<=" wants few hits.
        let mut look_at = if aim.starts_with("<=") { hits } else { misses };
        look_at.truncate(NAMED_MAX);
        Self { name: name.into(), aim: aim.into(), hits: count, of, interval: wilson(count, of), look_at }
    }

    /// Share of hits.
    pub fn share(&self) -> f64 {
        self.hits as f64 / self.of.max(1) as f64
    }
}

/// Wilson's 95 % interval of a binomial share.
pub fn wilson(hits: usize, of: usize) -> [f64; 2] {
    if of == 0 {
        return [0.0, 1.0];
    }
    const Z: f64 = 1.959_964;
    let (n, p) = (of as f64, hits as f64 / of as f64);
    let centre = (p + Z * Z / (2.0 * n)) / (1.0 + Z * Z / n);
    let half = Z / (1.0 + Z * Z / n) * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    [(centre - half).max(0.0), (centre + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_agrees_with_newcombes_table() {
        // Newcombe 1998, Statistics in Medicine 17, table I, method 3: 81/263, 15/148, 0/20, 1/29.
        for (hits, of, low, high) in
            [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)]
        {
            let [a, b] = wilson(hits, of);
            assert!((a - low).abs() < 1e-4 && (b - high).abs() < 1e-4, "{hits}/{of}: {a} {b}");
        }
    }
}
