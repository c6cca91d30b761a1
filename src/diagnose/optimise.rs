//! Downhill simplex (Nelder and Mead 1965): a handful of parameters, a cheap objective, no derivatives.

/// Minimise `objective` from `start` with first steps `width`, at most `evaluations` calls. Infinite values are walls.
pub fn nelder_mead(
    start: &[f64],
    width: &[f64],
    evaluations: usize,
    mut objective: impl FnMut(&[f64]) -> f64,
) -> Vec<f64> {
    let n = start.len();
    let mut simplex: Vec<(f64, Vec<f64>)> = vec![(objective(start), start.to_vec())];
    for i in 0..n {
        let mut p = start.to_vec();
        p[i] += width[i];
        simplex.push((objective(&p), p));
    }
    let mut calls = n + 1;
    while calls < evaluations {
        simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
        if simplex[n].0 - simplex[0].0 < 1e-3 {
            break;
        }
        let centre: Vec<f64> = (0..n).map(|j| simplex[..n].iter().map(|s| s.1[j]).sum::<f64>() / n as f64).collect();
        let towards = |scale: f64, worst: &[f64]| {
            (0..n).map(|j| centre[j] + scale * (worst[j] - centre[j])).collect::<Vec<f64>>()
        };
        let reflected = towards(-1.0, &simplex[n].1);
        let at_reflected = objective(&reflected);
        calls += 1;
        if at_reflected < simplex[0].0 {
            let expanded = towards(-2.0, &simplex[n].1);
            let at_expanded = objective(&expanded);
            calls += 1;
            simplex[n] = if at_expanded < at_reflected { (at_expanded, expanded) } else { (at_reflected, reflected) };
        } else if at_reflected < simplex[n - 1].0 {
            simplex[n] = (at_reflected, reflected);
        } else {
            let scale = if at_reflected < simplex[n].0 { -0.5 } else { 0.5 };
            let contracted = towards(scale, &simplex[n].1);
            let at_contracted = objective(&contracted);
            calls += 1;
            if at_contracted < simplex[n].0.min(at_reflected) {
                simplex[n] = (at_contracted, contracted);
            } else {
                let best = simplex[0].1.clone();
                for vertex in simplex.iter_mut().skip(1) {
                    vertex.1 = (0..n).map(|j| 0.5 * (vertex.1[j] + best[j])).collect();
                    vertex.0 = objective(&vertex.1);
                    calls += 1;
                }
            }
        }
    }
    simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
    simplex.swap_remove(0).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_valley_of_rosenbrock_is_followed_to_its_end() {
        let best = nelder_mead(&[-1.2, 1.0], &[0.5, 0.5], 2000, |p| {
            (1.0 - p[0]).powi(2) + 100.0 * (p[1] - p[0] * p[0]).powi(2)
        });
        assert!((best[0] - 1.0).abs() < 0.1 && (best[1] - 1.0).abs() < 0.2, "{best:?}");
    }
}
