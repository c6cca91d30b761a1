//! A CSV of a sensor with covariates, as its `case.toml` describes it, to block means.

use std::collections::{BTreeMap, BTreeSet};

use super::blunders;
use crate::diagnose::keys::lookup;
use crate::diagnose::measured::spread::{median, scatter};
use crate::diagnose::measured::{MeasuredCase, MeasuredError};

/// Block means are formed so that about so many remain: fine enough for hours, few enough for dense algebra.
const BLOCKS: f64 = 600.0;
/// With a reference beside it a series can be dated against it: blocks are then finer.
const BLOCKS_WITH_REFERENCE: f64 = 3_000.0;
const BLOCKS_MIN: usize = 40;
/// A span of fewer blocks tells nothing beside its own constant, and is left out.
const SPAN_BLOCKS_MIN: usize = 8;
/// A row this many scatters from the median of its block is a blunder, in blocks of so many rows or more.
const BLUNDER_SCATTERS: f64 = 12.0;
const BLUNDER_ROWS_MIN: usize = 8;

/// One measured axis or control.
#[derive(Debug, Clone)]
pub struct Axis {
    /// Column of the file.
    pub column: String,
    /// Short name for parameters: the axis, or the column.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Whether nothing is expected in it.
    pub control: bool,
    /// Block means, less those of the reference where there is one.
    pub values: Vec<f64>,
    /// Block means of what the simulation takes from another column.
    pub reference: Option<Vec<f64>>,
}

impl Axis {
    /// Differences smaller than this are rounding, not measurement.
    pub fn rounding(&self) -> f64 {
        let all = self.values.iter().chain(self.reference.iter().flatten());
        1e-12 * all.map(|v| v.abs()).fold(0.0, f64::max)
    }
}

/// One covariate.
#[derive(Debug, Clone)]
pub struct CovariateSeries {
    /// Column of the file.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Block means.
    pub values: Vec<f64>,
}

impl CovariateSeries {
    /// Whether it is a temperature.
    pub fn is_temperature(&self) -> bool {
        let unit: String = self.unit.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
        matches!(unit.as_str(), "c" | "degc" | "celsius" | "k" | "degk" | "kelvin" | "f" | "degf" | "fahrenheit")
    }

    /// Whether it is a component of a magnetic field.
    pub fn is_magnetic(&self) -> bool {
        matches!(self.unit.as_str(), "T" | "mT" | "uT" | "\u{b5}T" | "\u{3bc}T" | "nT" | "G" | "mG" | "gauss")
    }

    /// Its component, by the end of its name, or all of that.
    pub fn component(&self) -> &str {
        let end = self.name.rsplit(['_', '-', '.', ' ']).next().unwrap_or_default();
        if matches!(end, "x" | "y" | "z" | "X" | "Y" | "Z") { end } else { &self.name }
    }
}

/// The series as block means.
#[derive(Debug, Clone)]
pub struct Series {
    /// Middle of each block, s after the first row of the file.
    pub t_s: Vec<f64>,
    /// Which span each block lies in.
    pub span: Vec<usize>,
    /// How many spans.
    pub spans: usize,
    /// Axes, then controls.
    pub axes: Vec<Axis>,
    /// Covariates.
    pub covariates: Vec<CovariateSeries>,
    /// Covariates that could not be read in most rows: their names.
    pub unread: Vec<String>,
    /// Rows that could not be read, and blunders.
    pub masked: usize,
}

impl Series {
    /// The usual time from one block to the next, s.
    pub fn beat_s(&self) -> f64 {
        median(self.t_s.windows(2).map(|w| w[1] - w[0])).max(1e-12)
    }

    /// Length of the shortest span, s.
    pub fn shortest_span_s(&self) -> f64 {
        let length = |k: usize| {
            let inside = || self.t_s.iter().zip(&self.span).filter(move |(_, s)| **s == k).map(|(t, _)| *t);
            inside().fold(f64::NEG_INFINITY, f64::max) - inside().fold(f64::INFINITY, f64::min)
        };
        (0..self.spans).map(length).filter(|l| *l > 0.0).fold(f64::INFINITY, f64::min)
    }
}

struct Column {
    name: String,
    unit: String,
    axis: Option<String>,
    reference: Option<String>,
}

/// Read the series of a case.
pub fn series(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<Series, MeasuredError> {
    let file = case.text("recording.file")?;
    let values = columns(case, "recording.values")?;
    if values.is_empty() {
        return Err(case.wrong("recording.values", "at least one column"));
    }
    let controls = columns(case, "recording.controls")?;
    let covariates = columns(case, "recording.covariates")?;
    let references: Vec<Column> = values.iter().filter_map(Column::its_reference).collect();
    let needed = values.len() + controls.len();
    let all: Vec<&Column> = values.iter().chain(&controls).chain(&references).chain(&covariates).collect();
    let (t_s, mut table, mut masked) = rows(case, &file, &files[&file], &all, needed + references.len())?;
    let taken_out: BTreeSet<usize> = table.iter_mut().flat_map(|column| blunders::taken_out(column)).collect();
    masked += taken_out.len();
    // What nobody can read is followed by nothing that could be shown.
    let (mut read, mut unread) = (Vec::new(), Vec::new());
    for (column, values) in covariates.into_iter().zip(table.split_off(needed + references.len())) {
        if 2 * values.iter().filter(|v| v.is_finite()).count() < values.len() {
            unread.push(column.name);
        } else {
            read.push(column);
            table.push(values);
        }
    }
    let spans = spans(case)?;
    let count = if references.is_empty() { BLOCKS } else { BLOCKS_WITH_REFERENCE };
    let Blocks { t_s, span, mut table, masked: blunders } = blocks(&t_s, &table, &spans, count);
    if t_s.len() < BLOCKS_MIN {
        return Err(MeasuredError::TooFew { what: "blocks of rows", found: t_s.len(), expected: BLOCKS_MIN });
    }
    let of_covariates = table.split_off(needed + references.len());
    let mut references = table.split_off(needed).into_iter();
    let mut table = table.into_iter();
    let mut axis = |column: Column, control: bool| {
        let mut values = table.next().unwrap_or_default();
        let reference = column.reference.as_ref().filter(|_| !control).and_then(|_| references.next());
        if let Some(reference) = &reference {
            values.iter_mut().zip(reference).for_each(|(v, r)| *v -= r);
        }
        let name = column.axis.unwrap_or_else(|| column.name.clone());
        Axis { column: column.name, name, unit: column.unit, control, values, reference }
    };
    let mut axes: Vec<Axis> = values.into_iter().map(|c| axis(c, false)).collect();
    axes.extend(controls.into_iter().map(|c| axis(c, true)));
    let covariate = |(c, values): (Column, Vec<f64>)| CovariateSeries { name: c.name, unit: c.unit, values };
    let covariates = read.into_iter().zip(of_covariates).map(covariate).collect();
    // Spans without a row in them have no constant to estimate.
    let mut used: Vec<usize> = span.clone();
    used.dedup();
    let span: Vec<usize> = span.iter().map(|s| used.binary_search(s).unwrap_or(0)).collect();
    Ok(Series { t_s, span, spans: used.len(), axes, covariates, unread, masked: masked + blunders })
}

impl Column {
    fn its_reference(&self) -> Option<Self> {
        let name = self.reference.clone()?;
        Some(Self { name, unit: self.unit.clone(), axis: None, reference: None })
    }
}

fn columns(case: &MeasuredCase, key: &str) -> Result<Vec<Column>, MeasuredError> {
    let Some(value) = lookup(&case.table, key) else { return Ok(Vec::new()) };
    let wrong = || case.wrong(key, "a list of { column, unit }");
    let one = |entry: &toml::Value| {
        let text = |name: &str| entry.get(name).and_then(|v| v.as_str()).map(str::to_owned);
        let name = text("column").ok_or_else(wrong)?;
        let (axis, reference) = (text("axis"), text("reference"));
        Ok(Column { name, unit: text("unit").unwrap_or_default(), axis, reference })
    };
    value.as_array().ok_or_else(wrong)?.iter().map(one).collect()
}

fn spans(case: &MeasuredCase) -> Result<Vec<[f64; 2]>, MeasuredError> {
    let Some(value) = lookup(&case.table, "recording.spans_h") else { return Ok(Vec::new()) };
    let number = |v: &toml::Value| v.as_float().or_else(|| v.as_integer().map(|i| i as f64));
    let pair = |v: &toml::Value| -> Option<[f64; 2]> {
        let list: Vec<f64> = v.as_array()?.iter().map(number).collect::<Option<_>>()?;
        list.try_into().ok()
    };
    let spans = value.as_array().and_then(|list| list.iter().map(pair).collect::<Option<Vec<_>>>());
    let spans = spans.filter(|list| list.iter().all(|[from, to]| from < to)).map(|mut list| {
        list.sort_by(|a, b| a[0].total_cmp(&b[0]));
        list
    });
    spans.ok_or_else(|| case.wrong("recording.spans_h", "a list of [from, to] in hours"))
}

type Rows = (Vec<f64>, Vec<Vec<f64>>, usize);

/// Time in seconds after the first row, and the wanted columns, of which the first are `needed`. A cell that is no number has none; rows
/// without a time, or without any number that is needed, are left out and counted.
fn rows(case: &MeasuredCase, file: &str, text: &str, wanted: &[&Column], needed: usize) -> Result<Rows, MeasuredError> {
    let time = case.text("recording.time.column")?;
    let format = lookup(&case.table, "recording.time.format").and_then(|v| v.as_str());
    let mut reader = csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(text.as_bytes());
    let bad = |line: usize, expected: String, found: String| MeasuredError::Line {
        file: file.to_owned(),
        line,
        expected,
        found,
    };
    let header = reader.headers().map_err(|e| bad(1, "a header".to_owned(), e.to_string()))?.clone();
    let place = |name: &str| {
        let found = header.iter().collect::<Vec<_>>().join(",");
        header.iter().position(|h| h == name).ok_or_else(|| bad(1, format!("a column {name}"), found))
    };
    let time_at = place(&time)?;
    let places: Vec<usize> = wanted.iter().map(|c| place(&c.name)).collect::<Result<_, _>>()?;
    let (mut t_s, mut table, mut masked) = (Vec::new(), vec![Vec::new(); wanted.len()], 0);
    let mut first = None;
    // The first of the times, and of each column, that is none.
    let mut unread: Vec<Option<(usize, String, String)>> = vec![None; wanted.len() + 1];
    for record in reader.records() {
        let Ok(record) = record else {
            masked += 1;
            continue;
        };
        let stamp = record.get(time_at).and_then(|s| seconds(s, format));
        let number = |k: &usize| record.get(*k)?.parse::<f64>().ok().filter(|v| v.is_finite());
        let row: Vec<Option<f64>> = places.iter().map(number).collect();
        let line = record.position().map_or(0, |p| p.line() as usize);
        let field = |k: usize| record.get(k).unwrap_or_default().to_owned();
        if stamp.is_none() {
            let form = format.map_or("a time".to_owned(), |format| format!("a time as {format}"));
            unread[0].get_or_insert((line, format!("{form} in column {time}"), field(time_at)));
        }
        for (k, column) in wanted.iter().enumerate().filter(|(k, _)| row[*k].is_none()) {
            unread[k + 1].get_or_insert((line, format!("a number in column {}", column.name), field(places[k])));
        }
        match stamp.filter(|_| row[..needed].iter().any(Option::is_some)) {
            Some(stamp) => {
                t_s.push(stamp - *first.get_or_insert(stamp));
                table.iter_mut().zip(row).for_each(|(column, value)| column.push(value.unwrap_or(f64::NAN)));
            }
            None => masked += 1,
        }
    }
    // Holes are left out; a file, or a column of it, that is mostly holes is another than the case says.
    let all = masked + t_s.len();
    let holes = |k: usize| match k {
        0 => masked,
        k => all - table[k - 1].iter().filter(|v| v.is_finite()).count(),
    };
    let is_mostly = |k: &usize| 2 * holes(*k) > all;
    // Of several covariates one may be; that of the only one is no case.
    let mut covariates = needed + 1..=wanted.len();
    let none_read = covariates.clone().all(|k| is_mostly(&k)).then(|| covariates.next()).flatten();
    let mostly = (0..=needed).find(is_mostly).or(none_read).and_then(|k| Some((k, unread[k].clone()?)));
    if let Some((k, (line, expected, found))) = mostly {
        return Err(bad(line, format!("{expected} ({} of {all} rows cannot be read)", holes(k)), found));
    }
    let (t_s, table) = in_order(t_s, table);
    Ok((t_s, table, masked))
}

/// Rows by their time, after that of the earliest: a file may have the newest first, or a few that came late.
fn in_order(t_s: Vec<f64>, table: Vec<Vec<f64>>) -> (Vec<f64>, Vec<Vec<f64>>) {
    if t_s.is_sorted() {
        return (t_s, table);
    }
    let mut order: Vec<usize> = (0..t_s.len()).collect();
    order.sort_by(|a, b| t_s[*a].total_cmp(&t_s[*b]));
    let earliest = t_s[order[0]];
    let sorted = |column: &Vec<f64>| order.iter().map(|i| column[*i]).collect::<Vec<f64>>();
    (order.iter().map(|i| t_s[*i] - earliest).collect(), table.iter().map(sorted).collect())
}

fn seconds(text: &str, format: Option<&str>) -> Option<f64> {
    match format {
        // Seconds, or a date in the usual form.
        None => text.parse().ok().or_else(|| {
            let instant = text.parse::<jiff::Timestamp>().ok();
            let civil = || text.parse::<jiff::civil::DateTime>().ok()?.to_zoned(jiff::tz::TimeZone::UTC).ok();
            Some(instant.or_else(|| Some(civil()?.timestamp()))?.as_millisecond() as f64 / 1000.0)
        }),
        Some(format) => {
            let parsed = jiff::civil::DateTime::strptime(format, text).ok()?;
            Some(parsed.to_zoned(jiff::tz::TimeZone::UTC).ok()?.timestamp().as_millisecond() as f64 / 1000.0)
        }
    }
}

struct Blocks {
    t_s: Vec<f64>,
    span: Vec<usize>,
    table: Vec<Vec<f64>>,
    masked: usize,
}

/// Means over blocks of equal length, each inside one span, without the rows that the rest of their block contradicts.
fn blocks(t_s: &[f64], table: &[Vec<f64>], spans: &[[f64; 2]], count: f64) -> Blocks {
    let span_of = |t: f64| match spans {
        [] => Some(0),
        _ => spans.iter().position(|[from, to]| (from * 3600.0..=to * 3600.0).contains(&t)),
    };
    let inside: Vec<(usize, usize)> = (0..t_s.len()).filter_map(|i| Some((i, span_of(t_s[i])?))).collect();
    let times = || inside.iter().map(|(i, _)| t_s[*i]);
    let (first, last) = (times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max));
    let length = ((last - first) / count).max(1e-9);
    let mut members: BTreeMap<(usize, i64), Vec<usize>> = BTreeMap::new();
    for (i, span) in &inside {
        members.entry((*span, (t_s[*i] / length).floor() as i64)).or_default().push(*i);
    }
    let mut out = Blocks { t_s: Vec::new(), span: Vec::new(), table: vec![Vec::new(); table.len()], masked: 0 };
    let blocks_of = |span: usize| members.keys().filter(|(s, _)| *s == span).count();
    let long: Vec<bool> = (0..spans.len().max(1)).map(|span| blocks_of(span) >= SPAN_BLOCKS_MIN).collect();
    for ((span, _), rows) in members.into_iter().filter(|((span, _), _)| long[*span]) {
        let kept = agreeing(&rows, table);
        out.masked += rows.len() - kept.len();
        let mean = |column: &[f64]| {
            let read: Vec<f64> = kept.iter().map(|i| column[*i]).filter(|v| v.is_finite()).collect();
            read.iter().sum::<f64>() / read.len() as f64
        };
        let means: Vec<f64> = table.iter().map(|column| mean(column)).collect();
        // A block in which a column has no number is a gap.
        if means.iter().any(|mean| mean.is_nan()) {
            out.masked += kept.len();
            continue;
        }
        out.t_s.push(mean(t_s));
        out.span.push(span);
        out.table.iter_mut().zip(means).for_each(|(block, mean)| block.push(mean));
    }
    out
}

/// The rows of a block without blunders: far from the median of any column, by its own scatter. Few rows, or a column that
/// does not scatter, show none.
fn agreeing(rows: &[usize], table: &[Vec<f64>]) -> Vec<usize> {
    if rows.len() < BLUNDER_ROWS_MIN {
        return rows.to_vec();
    }
    let limits: Vec<(f64, f64)> = table
        .iter()
        .map(|column| {
            let values: Vec<f64> = rows.iter().map(|i| column[*i]).filter(|v| v.is_finite()).collect();
            let width = scatter(&values);
            (median(values), if width > 0.0 { BLUNDER_SCATTERS * width } else { f64::INFINITY })
        })
        .collect();
    let agrees = |i: &&usize| {
        table.iter().zip(&limits).all(|(column, (m, w))| column[**i].is_nan() || (column[**i] - m).abs() <= *w)
    };
    let kept: Vec<usize> = rows.iter().filter(agrees).copied().collect();
    // A block that falls apart is no block with blunders.
    if 2 * kept.len() > rows.len() { kept } else { rows.to_vec() }
}
