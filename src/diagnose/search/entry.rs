//! What is searched: a catalogue effect or an open form, at its starting points, with its priors. Not here: whitening, and which is best.

use crate::diagnose::catalogue::{Effect, LOG_PRIOR, Nonlinear, SELDOM_LARGE, Scale, Seldom, Shape, Theta};
use crate::diagnose::open_form::SIZE_NG;
use crate::diagnose::scene::Scene;
use crate::math::shared_work;

/// What a family is.
#[derive(Clone, Copy)]
pub enum Family {
    /// A catalogue effect.
    Listed(&'static Effect),
    /// An open form, by its place in the dictionary.
    Open(usize),
}

/// A family with its series at every starting point, before whitening.
pub struct Entry {
    /// What it is.
    pub family: Family,
    /// Log prior odds.
    pub log_prior: f64,
    /// Starting points.
    pub points: Vec<(Theta, Shape)>,
    /// Log share of the prior that each of them stands for.
    pub log_shares: Vec<f64>,
    /// Prior sizes of the coefficients.
    pub sizes: Vec<f64>,
    /// Prior means of the coefficients, in their own units.
    pub means: Vec<f64>,
}

impl Entry {
    /// A catalogue effect, `None` where the case does not allow it.
    pub fn listed(scene: &Scene, effect: &'static Effect) -> Option<Self> {
        let grid = (effect.grid)(scene);
        let at = |theta: &Theta| (effect.signature)(scene, theta).map(|shape| (*theta, shape));
        let points: Vec<(Theta, Shape)> = shared_work::map(&grid, at).into_iter().flatten().collect();
        (!points.is_empty()).then(|| Self {
            log_shares: log_shares(scene, effect, &points),
            points,
            ..Self::without_points(effect, 0.0)
        })
    }

    /// An effect under circumstances that are rarer.
    pub fn seldom(scene: &Scene, seldom: &Seldom) -> Option<Self> {
        Self::listed(scene, seldom.effect).map(|entry| Self { log_prior: LOG_PRIOR + seldom.log_odds, ..entry })
    }

    /// An effect, at log odds beside those of the others, without its starting points: to hold its place, or to be given some.
    pub fn without_points(effect: &'static Effect, log_odds: f64) -> Self {
        Self {
            family: Family::Listed(effect),
            log_prior: LOG_PRIOR + log_odds,
            points: Vec::new(),
            log_shares: Vec::new(),
            sizes: effect.linear.iter().map(|l| l.prior().size).collect(),
            means: effect.linear.iter().map(|l| l.prior().mean).collect(),
        }
    }

    /// The same at points of which each is as likely, `None` where there is none.
    pub fn at(self, points: Vec<(Theta, Shape)>) -> Option<Self> {
        (!points.is_empty()).then(|| Self { log_shares: equal(points.len()), points, ..self })
    }

    /// An open form.
    pub fn open(index: usize, shapes: Vec<Shape>, log_prior: f64) -> Self {
        let count = shapes.first().map_or(0, Shape::count);
        let sizes = vec![SIZE_NG; count];
        Self {
            family: Family::Open(index),
            log_prior,
            log_shares: equal(shapes.len()),
            points: shapes.into_iter().enumerate().map(|(i, shape)| ([i as f64, 0.0], shape)).collect(),
            sizes,
            means: vec![0.0; count],
        }
    }

    /// What the prior sizes may be multiplied by.
    pub(super) fn scales(&self) -> &'static [Scale] {
        self.effect().map_or(SELDOM_LARGE, |effect| effect.scales)
    }

    /// Log share of the prior that a factor on the prior sizes has.
    pub(super) fn log_share_of(&self, factor: f64) -> f64 {
        self.scales().iter().find(|scale| scale.factor == factor).map_or(0.0, |scale| scale.share.ln())
    }

    /// Usual size of coefficient `k` where nothing is believed of it beforehand.
    pub fn usual_size(&self, k: usize) -> f64 {
        self.effect().and_then(|effect| effect.linear.get(k)).map_or_else(|| self.sizes[k], |l| l.size)
    }

    /// The starting point that has half of the prior to itself.
    pub(super) fn atom(&self) -> Option<Theta> {
        let value = self.effect()?.nonlinear.iter().find_map(|parameter| parameter.atom)?;
        self.points.iter().map(|(theta, _)| *theta).find(|theta| theta[0] == value)
    }

    /// The catalogue effect it is, if it is one.
    pub fn effect(&self) -> Option<&'static Effect> {
        match self.family {
            Family::Listed(effect) => Some(effect),
            Family::Open(_) => None,
        }
    }
}

fn equal(points: usize) -> Vec<f64> {
    vec![-(points as f64).ln(); points]
}

/// Log shares of the prior that starting points stand for: equal where an effect has more than one parameter, or points in place of a
/// continuum.
fn log_shares(scene: &Scene, effect: &Effect, points: &[(Theta, Shape)]) -> Vec<f64> {
    match effect.nonlinear {
        [parameter] if parameter.step > 0.0 && points.len() > 1 => {
            let places: Vec<Theta> = points.iter().map(|(theta, _)| *theta).collect();
            log_shares_along(parameter, |x| (effect.log_density)(scene, &[x, 0.0]), &places)
        }
        _ => equal(points.len()),
    }
}

/// Of points along one parameter, each with the stretch half way to those of its way (the second number) beside it; one that has half of the
/// prior to itself has that.
fn log_shares_along(parameter: &Nonlinear, log_density: impl Fn(f64) -> f64, points: &[Theta]) -> Vec<f64> {
    let is_atom = |x: f64| parameter.atom == Some(x);
    let mass = |[x, way]: &Theta| {
        // The atom is where every way begins.
        let mut sorted: Vec<f64> =
            points.iter().filter(|[y, other]| other == way || is_atom(*y)).map(|[y, _]| *y).collect();
        sorted.sort_by(f64::total_cmp);
        let i = sorted.partition_point(|y| y < x);
        let [before, after] = [i.saturating_sub(1), (i + 1).min(sorted.len() - 1)];
        let stretch = (sorted[after] - sorted[before]) / (after - before) as f64;
        if is_atom(*x) { 0.0 } else { log_density(*x).exp() * stretch }
    };
    let masses: Vec<f64> = points.iter().map(mass).collect();
    let has_atom = points.iter().any(|[x, _]| is_atom(*x));
    let whole = masses.iter().sum::<f64>() * if has_atom { 2.0 } else { 1.0 };
    points.iter().zip(masses).map(|([x, _], mass)| if is_atom(*x) { 0.5_f64 } else { mass / whole }.ln()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::by_id;

    fn shares(id: &str, log_density: impl Fn(f64) -> f64, points: &[f64]) -> Vec<f64> {
        let parameter = &by_id(id).unwrap().nonlinear[0];
        let points: Vec<Theta> = points.iter().map(|x| [*x, 0.0]).collect();
        let shares: Vec<f64> = log_shares_along(parameter, log_density, &points).iter().map(|s| s.exp()).collect();
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{shares:?}");
        shares
    }

    #[test]
    fn points_share_the_prior_by_its_density_and_their_stretch() {
        let even = shares("bias_step", |_| -7.0, &[30.0, 10.0, 20.0]);
        assert!(even.iter().all(|s| (s - 1.0 / 3.0).abs() < 1e-12), "{even:?}");
        // Stretches of 10, 20 and 30.
        let wider = shares("bias_step", |_| -7.0, &[10.0, 20.0, 50.0]);
        assert!(
            wider.iter().zip([10.0, 20.0, 30.0]).all(|(s, stretch)| (s - stretch / 60.0).abs() < 1e-12),
            "{wider:?}"
        );
        let falling = shares("bias_step", |x| -x, &[0.0, 1.0, 2.0]);
        assert!((falling[0] / falling[1] - std::f64::consts::E).abs() < 1e-12, "{falling:?}");
        // No lag at all has half of the prior.
        let lags = shares("temperature_bias", |_| -3.0, &[0.0, 100.0, 200.0]);
        assert!(lags.iter().zip([0.5, 0.25, 0.25]).all(|(s, share)| (s - share).abs() < 1e-12), "{lags:?}");
    }
}
