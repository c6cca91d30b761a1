//! Downhill simplex (Nelder and Mead 1965): a handful of parameters, a cheap objective, no derivatives.

/// Minimise `objective` from `start` with first steps `width`, at most `evaluations` calls. Infinite values are walls.
pub fn nelder_mead(
    start: &[f64],
    width: &[f64],
    evaluations: usize,
    mut objective: impl FnMut(&[f64]) -> f64,
) -> Vec<f64> {
    let mut simplex = Simplex::new(start, width, evaluations);
    while let Some(point) = simplex.asks() {
        let value = objective(point);
        simplex.hears(value);
    }
    simplex.best()
}

/// A simplex on its way down: it asks for the value at a point, hears it, and asks for the next. So can several go side by side.
pub struct Simplex {
    vertices: Vec<(f64, Vec<f64>)>,
    width: Vec<f64>,
    calls: usize,
    evaluations: usize,
    asked: Vec<f64>,
    step: Step,
}

/// What the value asked for is of.
enum Step {
    /// A vertex of the first simplex.
    First,
    Reflection,
    /// Beyond a reflection that was the best.
    Expansion {
        reflection: (f64, Vec<f64>),
    },
    /// Nearer than a reflection of this value.
    Contraction {
        at_reflection: f64,
    },
    /// Vertex of a simplex shrunk towards its best.
    Shrinkage(usize),
    Done,
}

impl Simplex {
    /// From `start` with first steps `width`, at most `evaluations` calls.
    pub fn new(start: &[f64], width: &[f64], evaluations: usize) -> Self {
        let (asked, width) = (start.to_vec(), width.to_vec());
        Self { vertices: Vec::new(), width, calls: 0, evaluations, asked, step: Step::First }
    }

    /// The point whose value is asked for; none when it is done.
    pub fn asks(&self) -> Option<&[f64]> {
        (!matches!(self.step, Step::Done)).then_some(&self.asked)
    }

    /// Hears the value at the point asked for.
    pub fn hears(&mut self, value: f64) {
        let n = self.width.len();
        self.calls += 1;
        let asked = std::mem::take(&mut self.asked);
        match std::mem::replace(&mut self.step, Step::Done) {
            Step::First => {
                self.vertices.push((value, asked));
                let next = self.vertices.len();
                if next <= n {
                    self.asked = self.vertices[0].1.clone();
                    self.asked[next - 1] += self.width[next - 1];
                    self.step = Step::First;
                } else {
                    self.turn();
                }
            }
            Step::Reflection if value < self.vertices[0].0 => {
                self.asked = self.towards(-2.0);
                self.step = Step::Expansion { reflection: (value, asked) };
            }
            Step::Reflection if value < self.vertices[n - 1].0 => {
                self.vertices[n] = (value, asked);
                self.turn();
            }
            Step::Reflection => {
                self.asked = self.towards(if value < self.vertices[n].0 { -0.5 } else { 0.5 });
                self.step = Step::Contraction { at_reflection: value };
            }
            Step::Expansion { reflection } => {
                self.vertices[n] = if value < reflection.0 { (value, asked) } else { reflection };
                self.turn();
            }
            Step::Contraction { at_reflection } => {
                if value < self.vertices[n].0.min(at_reflection) {
                    self.vertices[n] = (value, asked);
                    self.turn();
                } else {
                    self.shrink(1);
                }
            }
            Step::Shrinkage(i) => {
                self.vertices[i] = (value, asked);
                if i < n { self.shrink(i + 1) } else { self.turn() }
            }
            Step::Done => {}
        }
    }

    /// The best point heard of.
    pub fn best(mut self) -> Vec<f64> {
        self.vertices.sort_by(|a, b| a.0.total_cmp(&b.0));
        self.vertices.swap_remove(0).1
    }

    /// The next iteration, if there is one.
    fn turn(&mut self) {
        let n = self.width.len();
        if self.calls >= self.evaluations {
            return;
        }
        self.vertices.sort_by(|a, b| a.0.total_cmp(&b.0));
        if self.vertices[n].0 - self.vertices[0].0 >= 1e-3 {
            self.asked = self.towards(-1.0);
            self.step = Step::Reflection;
        }
    }

    fn shrink(&mut self, i: usize) {
        let best = &self.vertices[0].1;
        self.asked = self.vertices[i].1.iter().zip(best).map(|(x, best)| 0.5 * (x + best)).collect();
        self.step = Step::Shrinkage(i);
    }

    /// From the centre of all but the worst vertex towards the worst.
    fn towards(&self, scale: f64) -> Vec<f64> {
        let n = self.width.len();
        let centre = |j: usize| self.vertices[..n].iter().map(|v| v.1[j]).sum::<f64>() / n as f64;
        let worst = &self.vertices[n].1;
        (0..n).map(|j| centre(j) + scale * (worst[j] - centre(j))).collect()
    }
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
