//! From windows to what a figure can show: means over bins, amplitudes by frequency.

/// Mean, its standard error and the middle of each bin that holds enough values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bin {
    /// Middle of the bin.
    pub x: f64,
    /// Mean of the values.
    pub mean: f64,
    /// Standard error of the mean, by the scatter in the bin.
    pub error: f64,
}

/// Fewest values a bin is drawn from.
const BIN_MIN: usize = 4;

/// Means of `y` in `bins` equal bins of `x` over its range.
pub fn binned(x: &[f64], y: &[f64], bins: usize) -> Vec<Bin> {
    let (low, high) = range(x.iter().copied());
    let width = ((high - low) / bins as f64).max(f64::MIN_POSITIVE);
    let mut sums = vec![(0usize, 0.0, 0.0); bins];
    for (x, y) in x.iter().zip(y) {
        let bin = &mut sums[(((x - low) / width) as usize).min(bins - 1)];
        bin.0 += 1;
        bin.1 += y;
        bin.2 += y * y;
    }
    let bin = |(k, (n, sum, squares)): (usize, &(usize, f64, f64))| {
        if *n < BIN_MIN {
            return None;
        }
        let n = *n as f64;
        let mean = sum / n;
        let variance = (squares / n - mean * mean).max(0.0);
        // Neighbouring windows overlap by half: a bin holds about two thirds as many independent values.
        Some(Bin { x: low + (k as f64 + 0.5) * width, mean, error: (1.5 * variance / n).sqrt() })
    };
    sums.iter().enumerate().filter_map(bin).collect()
}

/// Means over `span_s` of time, in runs without gaps: each run is a line to draw.
pub fn runs(clock_s: &[f64], y: &[f64], span_s: f64) -> Vec<Vec<(f64, f64)>> {
    let mut runs: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut cell: Option<(f64, f64, usize)> = None;
    let mut last_cell = f64::NEG_INFINITY;
    let mut close = |cell: &mut Option<(f64, f64, usize)>| {
        if let Some((index, sum, n)) = cell.take()
            && n >= 2
        {
            if index > last_cell + 1.5 || runs.is_empty() {
                runs.push(Vec::new());
            }
            last_cell = index;
            if let Some(run) = runs.last_mut() {
                run.push(((index + 0.5) * span_s, sum / n as f64));
            }
        }
    };
    for (t, y) in clock_s.iter().zip(y) {
        let index = (t / span_s).floor();
        match &mut cell {
            Some((current, sum, n)) if *current == index => {
                *sum += y;
                *n += 1;
            }
            _ => {
                close(&mut cell);
                cell = Some((index, *y, 1));
            }
        }
    }
    close(&mut cell);
    runs
}

/// Amplitude at each frequency (cycles per orbit) by least squares of one cosine and sine, the mean removed.
pub fn amplitudes(clock_s: &[f64], y: &[f64], period_s: f64, cycles: &[f64]) -> Vec<f64> {
    let mean = y.iter().sum::<f64>() / y.len().max(1) as f64;
    cycles
        .iter()
        .map(|cycles| {
            let rate = std::f64::consts::TAU * cycles / period_s;
            let (mut cc, mut ss, mut cs, mut cy, mut sy) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for (t, y) in clock_s.iter().zip(y) {
                let (s, c) = (rate * (t - clock_s[0])).sin_cos();
                cc += c * c;
                ss += s * s;
                cs += c * s;
                cy += c * (y - mean);
                sy += s * (y - mean);
            }
            let determinant = cc * ss - cs * cs;
            if determinant < 1e-9 * cc * ss || determinant <= 0.0 {
                return 0.0;
            }
            let (a, b) = ((cy * ss - sy * cs) / determinant, (sy * cc - cy * cs) / determinant);
            a.hypot(b)
        })
        .collect()
}

/// Least and greatest; 0 to 1 where there is nothing.
pub fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if low < high {
        (low, high)
    } else if low.is_finite() {
        (low - 0.5, low + 0.5)
    } else {
        (0.0, 1.0)
    }
}

/// Spans in which `inside` holds, from the windows' centres.
pub fn spans(clock_s: &[f64], inside: impl Fn(usize) -> bool) -> Vec<(f64, f64)> {
    let mut spans: Vec<(f64, f64)> = Vec::new();
    let mut open = false;
    for (k, t) in clock_s.iter().enumerate() {
        if !inside(k) {
            open = false;
            continue;
        }
        match spans.last_mut().filter(|last| open && t - last.1 < 300.0) {
            Some(last) => last.1 = *t,
            None => spans.push((*t, *t)),
        }
        open = true;
    }
    spans
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_amplitude_of_a_line_is_found_on_an_uneven_grid() {
        let clock: Vec<f64> = (0..3000).filter(|k| k % 500 > 60).map(|k| 25.0 * f64::from(k)).collect();
        let y: Vec<f64> = clock.iter().map(|t| 7.0 * (std::f64::consts::TAU * t * 2.0 / 5430.0 + 0.4).sin()).collect();
        let found = amplitudes(&clock, &y, 5430.0, &[2.0]);
        assert!((found[0] - 7.0).abs() < 0.05, "{found:?}");
    }

    #[test]
    fn a_gap_parts_two_runs() {
        let clock: Vec<f64> = (0..200).map(|k| if k < 100 { 25.0 } else { 5025.0 } + 25.0 * f64::from(k)).collect();
        let runs = runs(&clock, &vec![1.0; 200], 250.0);
        assert_eq!(runs.len(), 2);
        assert!(runs.iter().flatten().all(|p| (p.1 - 1.0).abs() < 1e-12));
    }
}
