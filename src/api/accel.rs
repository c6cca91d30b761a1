//! `/accel` and `/accel/history`.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use super::App;
use super::problem::Problem;
use super::query::{Asked, optional_clock};
use super::records::ask;
use crate::hub::wire::{self, BodyAxes, Gap, Time};
use crate::pipeline::Product;
use crate::pipeline::calibration::{Calibration, MeanError};
use crate::pipeline::product::Component;
use crate::units::Clock;

/// The latest body-axis value.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Accel {
    /// Start of the 50 s window.
    #[serde(flatten)]
    pub time: Time,
    /// `orbiter_body`: +X tail to nose, +Y to starboard, +Z down through the belly.
    pub frame: &'static str,
    /// The value and its standard errors.
    #[serde(flatten)]
    pub acceleration: BodyAxes,
    /// Time since this service came to know the value, s.
    pub age_s: f64,
    /// `good`, or reasons for care.
    pub quality: String,
    /// Version of the calibration.
    pub calibration: u32,
    /// Hash of what the value was made from.
    pub revision: String,
    /// Mission and spacecraft it is of.
    pub source: String,
}

/// The latest body-axis acceleration, with its standard error.
#[utoipa::path(get, path = "/accel", tag = "acceleration",
    responses((status = 200, description = "the latest one", body = Accel), (status = 404, description = "there is none yet")))]
pub async fn accel(State(app): State<Arc<App>>) -> Result<Json<Accel>, Problem> {
    let latest = app.hub.latest().ok_or_else(|| Problem::not_found("there is no calibrated window yet"))?;
    Ok(Json(Accel {
        time: Time::new(&app.mission, latest.product.start),
        frame: "orbiter_body",
        acceleration: BodyAxes::new(&latest.product.acceleration),
        age_s: (latest.since.elapsed().as_secs_f64() * 1000.0).round() / 1000.0,
        quality: latest.product.quality.to_string(),
        calibration: latest.product.calibration,
        revision: latest.product.revision.to_string(),
        source: format!("{}/{:#x}", app.hub.mission(), app.hub.spacecraft_id()),
    }))
}

/// A span of history.
#[derive(Debug, Clone, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct Span {
    /// First window start: clock seconds or RFC 3339; the first known without it.
    pub from: Option<String>,
    /// Last window start; the last known without it.
    pub to: Option<String>,
    /// At most so many buckets (1 to 100000; 2000 without it).
    #[param(value_type = Option<u32>, minimum = 1, maximum = 100_000)]
    pub max_points: Option<String>,
}

/// Least, mean and greatest of the windows of a bucket.
#[derive(Debug, Clone, Copy, Serialize, ToSchema)]
pub struct Spread {
    /// Least.
    pub min: f64,
    /// Mean.
    pub mean: f64,
    /// Greatest.
    pub max: f64,
}

/// Windows taken together.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Bucket {
    /// From the start of the first window in it to the end of the last.
    #[serde(flatten)]
    pub span: wire::Span,
    /// Windows in it.
    pub count: usize,
    /// Windows with a value on an axis.
    pub calibrated: usize,
    /// X, ng, of the windows with a value on that axis; null without one.
    pub ax_ng: Option<Spread>,
    /// Y, ng.
    pub ay_ng: Option<Spread>,
    /// Z, ng.
    pub az_ng: Option<Spread>,
    /// Root mean square of the windows' statistical standard errors, ng: of a window, and not of the mean.
    pub sigma_ax_ng: Option<f64>,
    /// Of Y.
    pub sigma_ay_ng: Option<f64>,
    /// Of Z.
    pub sigma_az_ng: Option<f64>,
    /// Statistical standard error of the mean, ng: noise averages down, the errors of bias law and scale factor are those of all windows
    /// together and do not. Null where a window is not by the calibration in use.
    pub sigma_mean_ax_ng: Option<f64>,
    /// Of Y.
    pub sigma_mean_ay_ng: Option<f64>,
    /// Of Z.
    pub sigma_mean_az_ng: Option<f64>,
    /// Systematic standard error, the same for one window and for the mean, to be added in quadrature, ng.
    pub sigma_sys_ax_ng: Option<f64>,
    /// Of Y.
    pub sigma_sys_ay_ng: Option<f64>,
    /// Of Z.
    pub sigma_sys_az_ng: Option<f64>,
    /// Mode of its first window.
    pub mode: &'static str,
    /// Quality of the window with most reasons for care.
    pub worst_quality: String,
}

/// The answer of `/accel/history`.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct History {
    /// `orbiter_body`.
    pub frame: &'static str,
    /// Windows in the span.
    pub windows: usize,
    /// In order of time; a bucket without a window is left out.
    pub buckets: Vec<Bucket>,
    /// Spans without telemetry that touch the span asked for.
    pub gaps: Vec<Gap>,
}

/// Buckets asked for when nothing is said.
const POINTS: usize = 2000;
/// Most buckets of one answer.
const POINTS_MAX: usize = 100_000;

/// Body-axis acceleration over a span: min, mean and max in buckets.
#[utoipa::path(get, path = "/accel/history", tag = "acceleration", params(Span),
    responses((status = 200, description = "buckets, and gaps apart", body = History)))]
pub async fn history(State(app): State<Arc<App>>, Asked(span): Asked<Span>) -> Result<Json<History>, Problem> {
    let from = optional_clock(&app.mission, "from", span.from.as_deref())?;
    let to = optional_clock(&app.mission, "to", span.to.as_deref())?;
    let points = points(span.max_points.as_deref())?;
    if let (Some(from), Some(to)) = (from, to)
        && from > to
    {
        let detail = format!("from is clock {} s, after to, clock {} s", from.seconds(), to.seconds());
        return Err(Problem::bad_request(detail));
    }
    let Some((first, last)) = app.hub.span() else {
        return Ok(Json(History { frame: "orbiter_body", windows: 0, buckets: Vec::new(), gaps: Vec::new() }));
    };
    let (from, to) = (from.unwrap_or(first), to.unwrap_or(last));
    let products = app.hub.history(from, to);
    let buckets = in_buckets(&products, from, to, points);
    let errors = if buckets.iter().all(|products| products.len() == 1) {
        let alone = |products: &&[Product]| products[0].acceleration.each(|axis| axis.sigma_ng);
        buckets.iter().map(alone).collect()
    } else {
        let products = products.clone();
        ask(&app, move |station| mean_errors(station.calibration(), &in_buckets(&products, from, to, points))).await
    };
    let picture = app.board.picture();
    let touching = picture.gaps.iter().filter(|(start, end)| *end >= from && *start <= to);
    Ok(Json(History {
        frame: "orbiter_body",
        windows: products.len(),
        buckets: buckets.into_iter().zip(errors).map(|(products, error)| bucket(&app, products, error)).collect(),
        gaps: touching.map(|(start, end)| Gap::new(&app.mission, *start, *end)).collect(),
    }))
}

fn points(text: Option<&str>) -> Result<usize, Problem> {
    let Some(text) = text else { return Ok(POINTS) };
    match text.parse() {
        Ok(points) if (1..=POINTS_MAX).contains(&points) => Ok(points),
        _ => Err(Problem::bad_request(format!("max_points is {text:?}; a whole number from 1 to {POINTS_MAX}"))),
    }
}

/// Windows (in order of time) cut into at most so many spans of equal length; single windows where that is few enough.
fn in_buckets(products: &[Product], from: Clock, to: Clock, points: usize) -> Vec<&[Product]> {
    if products.len() <= points {
        return products.chunks(1).collect();
    }
    let span_tenths = (to.tenths() - from.tenths() + 1) as i128;
    let bucket_of = |product: &Product| (product.start.tenths() - from.tenths()) as i128 * points as i128 / span_tenths;
    products.chunk_by(|a, b| bucket_of(a) == bucket_of(b)).collect()
}

/// The standard error of each bucket's mean, where its windows are by the calibration in use.
fn mean_errors(calibration: Option<&Calibration>, buckets: &[&[Product]]) -> Vec<[Option<f64>; 3]> {
    let Some(calibration) = calibration else { return vec![[None; 3]; buckets.len()] };
    let by_it = |product: &Product| !product.acceleration.is_any() || product.calibration == calibration.version;
    let error = MeanError::new(calibration);
    let of = |products: &&[Product]| if products.iter().all(by_it) { error.of(products) } else { [None; 3] };
    buckets.iter().map(of).collect()
}

fn bucket(app: &App, products: &[Product], error: [Option<f64>; 3]) -> Bucket {
    const WINDOW_TENTHS: i64 = 500;
    let (first, last) = (&products[0], &products[products.len() - 1]);
    let end = last.start.plus_tenths(WINDOW_TENTHS);
    let calibrated = products.iter().filter(|product| product.acceleration.is_any()).count();
    let of_axis = |axis: usize| products.iter().filter_map(move |product| product.acceleration.0[axis]);
    let mean = |axis: usize, figure: fn(Component) -> f64| {
        let n = of_axis(axis).count();
        (n > 0).then(|| of_axis(axis).map(figure).sum::<f64>() / n as f64)
    };
    let spread = |axis: usize| {
        let values = || of_axis(axis).map(|of| of.trimmed_ng);
        Some(Spread {
            min: rounded(values().fold(f64::INFINITY, f64::min)),
            mean: rounded(mean(axis, |of| of.trimmed_ng)?),
            max: rounded(values().fold(f64::NEG_INFINITY, f64::max)),
        })
    };
    let sigma = |axis: usize| mean(axis, |of| of.sigma_ng.powi(2)).map(f64::sqrt).map(rounded);
    let of_mean = |axis: usize| error[axis].map(rounded);
    let systematic = |axis: usize| mean(axis, |of| of.sigma_sys_ng).map(rounded);
    let worst = products.iter().map(|product| product.quality).max_by_key(|quality| (quality.reasons(), *quality));
    Bucket {
        span: wire::Span::new(&app.mission, first.start, end),
        count: products.len(),
        calibrated,
        ax_ng: spread(0),
        ay_ng: spread(1),
        az_ng: spread(2),
        sigma_ax_ng: sigma(0),
        sigma_ay_ng: sigma(1),
        sigma_az_ng: sigma(2),
        sigma_mean_ax_ng: of_mean(0),
        sigma_mean_ay_ng: of_mean(1),
        sigma_mean_az_ng: of_mean(2),
        sigma_sys_ax_ng: systematic(0),
        sigma_sys_ay_ng: systematic(1),
        sigma_sys_az_ng: systematic(2),
        mode: first.mode.word(),
        worst_quality: worst.unwrap_or_default().to_string(),
    }
}

/// To the third decimal, as everywhere in ng; never a negative zero.
fn rounded(ng: f64) -> f64 {
    (ng * 1000.0).round() / 1000.0 + 0.0
}
