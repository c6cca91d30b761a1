//! The page: words and tables round the figures. One file, no script, nothing fetched; made to be printed.

use std::fmt::Write;

use super::plates::Plates;
use crate::paper::Figures;
use crate::paper::page::{self, close, escaped, figure, open, table, words};
use crate::pipeline::calibration::accuracy::{AxisAccuracy, published, quadrature, statistical_error};
use crate::pipeline::calibration::{Bias, Derived};
use crate::pipeline::station::Station;
use crate::telemetry::{Axis, Range};

/// What this page has beside the common style: its tables are long and wide.
const MORE: &str =
    "td.n, th.n { white-space: nowrap; } @media print { table { font-size: 8.5pt; break-inside: auto; } }";

/// The whole page.
pub fn page(station: &Station, plates: &Plates, Figures { shown: figures, missing }: &Figures) -> String {
    let title = format!("Mission {}: calibration and accelerations", station.settings().mission);
    let mut page = open(&title, &title, MORE, "");
    let _ = writeln!(page, "<p class=\"under\">{}</p>", escaped(&under(station, plates)));
    let derived = station.derived();
    accuracy(&mut page, derived);
    anomalies(&mut page, station);
    page.push_str("<h2>Bias</h2>\n");
    for range in ["c", "b", "a"] {
        let upper = range.to_uppercase();
        figure(
            &mut page,
            figures,
            &format!("bias_{range}.svg"),
            &format!(
                "Range {upper}: bias measured (points with one standard error), fitted (line, with two standard errors as a band), and \
             measured less fitted. A red cross is a measurement that is not used: an outlier, or one taken while the Orbiter turned; \
             beyond the scale it lies at the edge."
            ),
        );
    }
    laws(&mut page, derived);
    scales(&mut page, station, figures);
    corrections(&mut page, derived);
    page.push_str("<h2>Histories</h2>\n");
    for (n, history) in plates.histories.iter().enumerate() {
        let caption = format!(
            "{:.0} to {:.0} h after lift-off, body axes: mean of the 50 s windows (line) between their least and greatest (grey); \
             manoeuvres leave the scale.",
            history.span_h[0], history.span_h[1]
        );
        figure(&mut page, figures, &format!("history_{:02}.svg", n + 1), &caption);
    }
    if !missing.is_empty() {
        let _ = writeln!(page, "<p>Figures that could not be drawn: {}</p>", escaped(&missing.join("; ")));
    }
    close(
        &mut page,
        "a = (counts - bias) SF<sub>N</sub> SF<sub>C</sub>. Errors are one standard error. Body axes: X tail to nose, Y starboard, Z \
         through the belly; 1 ng is 9.80665e-9 m/s&sup2;. Published figures: J. E. Rice, NASA CR-198552 (1996).",
    );
    page
}

fn under(station: &Station, plates: &Plates) -> String {
    let windows = station.products().count();
    let calibrated = station.products().filter(|product| product.acceleration.whole().is_some()).count();
    let [from, to] = plates.span_h;
    let gaps = station.gaps();
    let missing_s: f64 = gaps.iter().fold(0.0, |sum, (from, to)| sum + to.seconds() - from.seconds());
    format!(
        "{from:.1} to {to:.1} h after lift-off · {windows} windows of 50 s, {calibrated} of them calibrated · {} gaps, {missing_s:.0} s \
         missing · {} versions of the calibration",
        gaps.len(),
        station.derived().timeline.len()
    )
}

fn capital(axis: Axis) -> String {
    axis.letter().to_uppercase()
}

fn accuracy(page: &mut String, derived: &Derived) {
    page.push_str("<h2>Accuracy in range C</h2>\n");
    let of: Vec<(Axis, &AxisAccuracy)> =
        Axis::ALL.into_iter().filter_map(|axis| Some((axis, derived.accuracy[axis.index()].as_ref()?))).collect();
    if of.is_empty() {
        page.push_str("<p>No calibration came down: nothing is known of the accuracy.</p>\n");
        return;
    }
    let rows = of.iter().map(|(axis, a)| {
        let i = axis.index();
        let [counts, ng] = [published::BIAS_FIT_COUNTS[i], published::BIAS_FIT_NG[i]];
        vec![
            capital(*axis),
            a.signal_difference_rms_counts.map_or("-".into(), |rms| format!("{rms:.1}")),
            format!("{:.0}", published::SIGNAL_DIFFERENCE_COUNTS[i]),
            format!("{:.1} ({:.1})", a.bias_fit_rms_counts, a.bias_fit_rms_used_counts),
            format!("{:.0} ({:.0})", counts[0], counts[1]),
            format!("{:.0} ({:.0})", a.bias_fit_rms_ng, a.bias_fit_rms_used_ng),
            format!("{:.0} ({:.0})", ng[0], ng[1]),
        ]
    });
    table(
        page,
        "Differences, RMS (counterpart of Table 4): of half the change of the signal over 75 s, and of measured less fitted bias, in \
         parentheses without outliers",
        &["axis", "#signal, counts", "#STS-65", "#bias fit, counts", "#STS-65", "#bias fit, ng", "#STS-65"],
        rows,
    );
    let quiet = of.iter().map(|(axis, a)| {
        let i = axis.index();
        let all = published::STS62_ALL[i];
        let still = published::STS62_QUIET[i];
        let [rms, ng] = a
            .quiet_fit_rms
            .map_or(["-".into(), "-".into()], |[counts, ng]| [format!("{counts:.1}"), format!("{ng:.0}")]);
        vec![
            capital(*axis),
            format!("{}", a.measurements),
            format!("{:.0}", a.bias_fit_rms_used_ng),
            format!("{:.0}", all[1]),
            format!("{}", a.quiet_measurements),
            rms,
            ng,
            format!("{:.0}", still[1]),
        ]
    });
    table(
        page,
        "Bias fit, all measurements and those in quiet periods, RMS (counterpart of Table 5)",
        &["axis", "#measured", "#all, ng", "#STS-62 all", "#quiet", "#counts", "#ng", "#STS-62 quiet"],
        quiet,
    );
    let rows = of.iter().map(|(axis, a)| {
        let i = axis.index();
        let print = published::STS65_STATISTICAL_NG[i];
        vec![
            capital(*axis),
            format!("{:.1}", a.degrees_of_freedom),
            format!("{:.1}", a.statistical_ng),
            format!("{print:.0}"),
            format!("{:.1}", a.fitted_sigma_ng),
            format!("{:.1}", a.total_ng),
            format!("{:.0}", quadrature(&[print, super::SYSTEMATIC_NG])),
        ]
    });
    table(
        page,
        "Error of the fitted bias, ng (counterpart of Table 6): RMS over the root of the degrees of freedom; the mean standard error that \
         the law itself gives and the products carry; the first with 20 ng systematic in quadrature. The scale factor adds 1 to 2 % of the signal.",
        &["axis", "#degrees of freedom", "#statistical", "#STS-65", "#of the law", "#with systematic", "#STS-65"],
        rows,
    );
    // The print's own numbers must follow from each other wherever they stand beside ours.
    debug_assert!((statistical_error(published::BIAS_FIT_NG[0][0], 78.0) - 48.0).abs() < 1.0);
}

fn anomalies(page: &mut String, station: &Station) {
    page.push_str("<h2>What went wrong with the instrument</h2>\n");
    let found = &station.derived().anomalies;
    if found.is_empty() {
        page.push_str("<p>Nothing that the telemetry shows.</p>\n");
        return;
    }
    let time = station.settings().time;
    let rows = found.iter().map(|a| {
        vec![
            words(a.kind.word()),
            format!("{:.2} to {:.2}", time.met_h(a.from.seconds()), time.met_h(a.to.seconds())),
            with_error(a.value, a.sigma) + " " + a.unit,
            a.sentence.clone(),
        ]
    });
    table(page, "", &["~what", "~when, h after lift-off", "#size", "in words"], rows);
}

fn laws(page: &mut String, derived: &Derived) {
    let Some(calibration) = &derived.estimated else { return };
    let mut rows = Vec::new();
    for range in [Range::C, Range::B, Range::A] {
        for axis in Axis::ALL {
            let Some(Bias::Fitted(fit)) = &calibration.bias[axis.index()][range.index()] else { continue };
            let sigma = |n: usize| fit.covariance[n][n].max(0.0).sqrt();
            let mut row = vec![format!("{} {}", capital(axis), range.letter())];
            row.extend((0..4).map(|n| with_error(fit.law.a[n], sigma(n))));
            row.extend((0..2).map(|n| with_error(fit.law.t_h[n], fit.law.t_h[n] * sigma(4 + n))));
            row.push(format!("{:.0}", fit.degrees_of_freedom));
            row.push(fit.r_squared.map_or("-".into(), |r| format!("{r:.3}")));
            row.push(format!("{}", fit.weights.iter().filter(|w| **w == 0.0).count()));
            row.push(if fit.carried.iter().all(|c| *c) { "all six".into() } else { fit.form().into() });
            rows.push(row);
        }
    }
    table(
        page,
        "The law A1 + A2 exp(-t/t0) + A3 exp(-t/t1) + A4 T, counts, hours and C. What the measurements do not carry stays at its \
         expectation, with its width as the error.",
        &["~law", "#A1", "#A2", "#A3", "#A4", "#t0", "#t1", "#d.o.f.", "#R²", "#out", "carried"],
        rows,
    );
}

fn scales(page: &mut String, station: &Station, figures: &[(String, String)]) {
    let Some(calibration) = station.calibration() else { return };
    page.push_str("<h2>Scale factors</h2>\n");
    figure(
        page,
        figures,
        "scale.svg",
        "Scale correction, actual over nominal, of each scale calibration with one standard error; the mean used, with two, as a band.",
    );
    let derived = station.derived();
    let rows = Axis::ALL.into_iter().flat_map(|axis| {
        Range::ALL.into_iter().rev().map(move |range| {
            let scale = calibration.scale[axis.index()][range.index()];
            let of = || derived.scales.iter().filter(move |(s, _)| s.axis == axis && s.range == range);
            let used = of().filter(|(_, m)| m.is_some()).count();
            let mut refused: Vec<&str> = of().filter_map(|(s, _)| s.refusal.map(|r| r.word())).collect();
            refused.dedup();
            vec![
                format!("{} {}", capital(axis), range.letter()),
                with_error(scale.correction, scale.sigma),
                words(scale.provenance.word()),
                format!("{used} of {}", of().count()),
                words(&refused.join(", ")),
            ]
        })
    });
    table(page, "", &["~factor", "#correction", "~from", "#sequences", "not used because of"], rows);
}

fn corrections(page: &mut String, derived: &Derived) {
    page.push_str("<h2>Clocks and estimators</h2>\n");
    let rows = derived.time_correlation.pieces.iter().map(|p| {
        vec![
            format!("{:.0} to {:.0}", p.span[0].seconds(), p.span[1].seconds()),
            format!("{:.4}", p.offset_s),
            with_error(p.drift_ppm, p.drift_sigma_ppm),
            format!("{:.1}", 1000.0 * p.residual_s),
            format!("{}", p.records),
        ]
    });
    table(
        page,
        "UTC against the instrument's clock",
        &["~clock, s", "#unix time less clock, s", "#drift, ppm", "#scatter, ms", "#records"],
        rows,
    );
    let one_sided = &derived.one_sided;
    let text = match one_sided.flew() {
        Some(true) => format!(
            "The on-board estimator is the one that drops a point more at the high end: {} of {} estimates agree with it bit for bit. Biases \
             here are measured on the ground, where nothing is dropped: A1 is not raised.",
            one_sided.flight_exact, one_sided.compared
        ),
        Some(false) => format!(
            "The on-board estimator is the two-sided one: {} of {} estimates agree with it bit for bit.",
            one_sided.right_exact, one_sided.compared
        ),
        None => "Too few on-board estimates came down to tell which estimator flew.".into(),
    };
    let _ = writeln!(page, "<p>{}</p>", escaped(&text));
}

/// Value and error in one cell.
fn with_error(value: f64, sigma: f64) -> String {
    match page::with_error(value, sigma) {
        (value, error) if error.is_empty() => value,
        (value, error) => format!("{value} ± {error}"),
    }
}
