//! A CSV of a sensor with covariates, as its `case.toml` describes it, to block means.

use std::collections::BTreeMap;

use crate::diagnose::measured::{MeasuredCase, MeasuredError, lookup};

/// Block means are formed so that about so many remain: fine enough for hours, few enough for dense algebra.
const BLOCKS: f64 = 600.0;
const BLOCKS_MIN: usize = 40;

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
    /// Block means.
    pub values: Vec<f64>,
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
        matches!(self.unit.as_str(), "C" | "degC" | "K")
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
    /// Rows that could not be read.
    pub masked: usize,
}

struct Column {
    name: String,
    unit: String,
    axis: Option<String>,
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
    let all: Vec<&Column> = values.iter().chain(&controls).chain(&covariates).collect();
    let (t_s, table, masked) = rows(case, &file, &files[&file], &all)?;
    let spans = spans(case)?;
    let (t_s, span, table) = blocks(&t_s, &table, &spans);
    if t_s.len() < BLOCKS_MIN {
        return Err(MeasuredError::TooFew { what: "blocks of rows", found: t_s.len(), expected: BLOCKS_MIN });
    }
    let mut table = table.into_iter();
    let mut axis = |column: Column, control: bool| {
        let name = column.axis.unwrap_or_else(|| column.name.clone());
        Axis { column: column.name, name, unit: column.unit, control, values: table.next().unwrap_or_default() }
    };
    let mut axes: Vec<Axis> = values.into_iter().map(|c| axis(c, false)).collect();
    axes.extend(controls.into_iter().map(|c| axis(c, true)));
    let covariate =
        |c: Column| CovariateSeries { name: c.name, unit: c.unit, values: table.next().unwrap_or_default() };
    let covariates = covariates.into_iter().map(covariate).collect();
    Ok(Series { t_s, span, spans: spans.len().max(1), axes, covariates, masked })
}

fn columns(case: &MeasuredCase, key: &str) -> Result<Vec<Column>, MeasuredError> {
    let Some(value) = lookup(&case.table, key) else { return Ok(Vec::new()) };
    let wrong = || case.wrong(key, "a list of { column, unit }");
    let one = |entry: &toml::Value| {
        let text = |name: &str| entry.get(name).and_then(|v| v.as_str()).map(str::to_owned);
        let name = text("column").ok_or_else(wrong)?;
        Ok(Column { name, unit: text("unit").unwrap_or_default(), axis: text("axis") })
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
    spans.ok_or_else(|| case.wrong("recording.spans_h", "a list of [from, to] in hours"))
}

type Rows = (Vec<f64>, Vec<Vec<f64>>, usize);

/// Time in seconds after the first row, and the wanted columns; rows with a hole are left out and counted.
fn rows(case: &MeasuredCase, file: &str, text: &str, wanted: &[&Column]) -> Result<Rows, MeasuredError> {
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
    for record in reader.records() {
        let Ok(record) = record else {
            masked += 1;
            continue;
        };
        let stamp = record.get(time_at).and_then(|s| seconds(s, format));
        let row: Option<Vec<f64>> =
            places.iter().map(|k| record.get(*k)?.parse::<f64>().ok().filter(|v| v.is_finite())).collect();
        match (stamp, row) {
            (Some(stamp), Some(row)) => {
                t_s.push(stamp - *first.get_or_insert(stamp));
                table.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
            }
            _ => masked += 1,
        }
    }
    if t_s.len() < masked {
        let found = format!("{masked} of {} rows unreadable", masked + t_s.len());
        return Err(bad(2, format!("numbers and times as {}", format.unwrap_or("numbers")), found));
    }
    Ok((t_s, table, masked))
}

fn seconds(text: &str, format: Option<&str>) -> Option<f64> {
    match format {
        None => text.parse().ok(),
        Some(format) => {
            let parsed = jiff::civil::DateTime::strptime(format, text).ok()?;
            Some(parsed.to_zoned(jiff::tz::TimeZone::UTC).ok()?.timestamp().as_millisecond() as f64 / 1000.0)
        }
    }
}

/// Means over blocks of equal length, each inside one span.
fn blocks(t_s: &[f64], table: &[Vec<f64>], spans: &[[f64; 2]]) -> (Vec<f64>, Vec<usize>, Vec<Vec<f64>>) {
    let span_of = |t: f64| match spans {
        [] => Some(0),
        _ => spans.iter().position(|[from, to]| (from * 3600.0..=to * 3600.0).contains(&t)),
    };
    let inside: Vec<(usize, usize)> = (0..t_s.len()).filter_map(|i| Some((i, span_of(t_s[i])?))).collect();
    let length = inside.first().zip(inside.last()).map_or(1.0, |(a, b)| (t_s[b.0] - t_s[a.0]) / BLOCKS).max(1e-9);
    let mut sums: BTreeMap<(usize, i64), (f64, Vec<f64>)> = BTreeMap::new();
    for (i, span) in inside {
        let key = (span, (t_s[i] / length).floor() as i64);
        let (count, sum) = sums.entry(key).or_insert_with(|| (0.0, vec![0.0; table.len() + 1]));
        *count += 1.0;
        sum[0] += t_s[i];
        sum[1..].iter_mut().zip(table).for_each(|(s, column)| *s += column[i]);
    }
    let (mut times, mut span, mut out) = (Vec::new(), Vec::new(), vec![Vec::new(); table.len()]);
    for ((which, _), (count, sum)) in sums {
        times.push(sum[0] / count);
        span.push(which);
        out.iter_mut().zip(&sum[1..]).for_each(|(column, s)| column.push(s / count));
    }
    (times, span, out)
}
