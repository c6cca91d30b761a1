//! The CSV files of a case, by the names of their columns.

use super::{Ancillary, Event, Files, Recording, Simulation, Texts, WINDOWS_MIN, one_line};
use crate::diagnose::error::CaseError;

/// The text of a file the case names.
pub fn given<'a>(file: &str, text: &'a Option<String>) -> Result<&'a str, CaseError> {
    if file.is_empty() {
        return Err(CaseError::Unnamed);
    }
    text.as_deref().ok_or_else(|| CaseError::MissingFile { file: file.to_string() })
}

/// The mission log; none where the case names none.
pub fn log(file: &str, text: &Option<String>) -> Result<Vec<Event>, CaseError> {
    match text {
        Some(text) => events(file, text),
        None if file.is_empty() => Ok(Vec::new()),
        None => Err(CaseError::MissingFile { file: file.to_string() }),
    }
}

/// An error whose line counts rows, one a line below the header, at the line of its file where that row is: there may be empty lines, and
/// breaks in quotes.
pub fn placed(mut error: CaseError, files: &Files, texts: &Texts) -> CaseError {
    let all = [
        (&files.recording, &texts.recording),
        (&files.simulation, &texts.simulation),
        (&files.ancillary, &texts.ancillary),
        (&files.events, &texts.events),
    ];
    let of = error.file().and_then(|file| all.into_iter().find(|(name, _)| *name == file));
    if let (Some((_, Some(text))), Some(line)) = (of, error.line_mut()) {
        let mut reader = table(text);
        let row = reader.records().nth(*line - 2).and_then(Result::ok);
        *line = row.and_then(|row| row.position().map(|place| place.line() as usize)).unwrap_or(*line);
    }
    error
}

/// Reader of a CSV; blanks around cells and behind the last row are none of it.
fn table(text: &str) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.trim_end().as_bytes())
}

/// Columns of a CSV by name, every cell a finite number.
fn columns(file: &str, text: &str, names: &[&str]) -> Result<Vec<Vec<f64>>, CaseError> {
    let mut reader = table(text);
    let csv_error = |e: csv::Error| unread(file, &e);
    let header = reader.headers().map_err(csv_error)?.clone();
    let place = |name: &&str| match header.iter().filter(|h| h == name).count() {
        0 | 1 => header.iter().position(|h| h == *name).ok_or_else(|| missing(file, name, &header)),
        times => Err(CaseError::RepeatedColumn { file: file.into(), column: name.to_string(), times }),
    };
    let places = names.iter().map(place).collect::<Result<Vec<usize>, _>>()?;
    let mut out = vec![Vec::new(); names.len()];
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(csv_error)?;
        for ((place, name), column) in places.iter().zip(names).zip(&mut out) {
            let cell = &record[*place];
            match cell.parse::<f64>() {
                Ok(value) if value.is_finite() => column.push(value),
                _ => {
                    return Err(CaseError::NotANumber {
                        file: file.into(),
                        line: row + 2,
                        column: name.to_string(),
                        found: cell.into(),
                    });
                }
            }
        }
    }
    Ok(out)
}

/// A line that is no row of the table.
fn unread(file: &str, error: &csv::Error) -> CaseError {
    let reason = match error.kind() {
        csv::ErrorKind::UnequalLengths { pos, expected_len, len } => {
            let line = pos.as_ref().map_or_else(String::new, |pos| format!("line {}: ", pos.line()));
            format!("{line}{len} cells, and the header has {expected_len}")
        }
        _ => one_line(&error.to_string()),
    };
    CaseError::Csv { file: file.into(), reason }
}

/// A column that is not in a header: that may be no header, or a line of a file that is no text.
fn missing(file: &str, column: &str, header: &csv::StringRecord) -> CaseError {
    const SHOWN: usize = 300;
    let found: String = header.iter().collect::<Vec<_>>().join(", ").escape_debug().take(SHOWN + 1).collect();
    let mut found =
        if found.chars().count() > SHOWN { found.chars().take(SHOWN).chain("...".chars()).collect() } else { found };
    if header.len() == 1 && header[0].contains([';', '\t']) {
        found += " (commas are expected between the cells)";
    }
    CaseError::MissingColumn { file: file.into(), column: column.into(), found }
}

/// Times that are enough and increase.
pub fn increasing(file: &str, clock_s: &[f64], needed: usize) -> Result<(), CaseError> {
    if clock_s.len() < needed {
        return Err(CaseError::TooFew { file: file.into(), found: clock_s.len(), needed });
    }
    match clock_s.windows(2).position(|w| w[1] <= w[0]) {
        Some(i) => {
            Err(CaseError::TimeOrder { file: file.into(), line: i + 3, found: clock_s[i + 1], before: clock_s[i] })
        }
        None => Ok(()),
    }
}

/// Windows of a recording.
pub fn recording(file: &str, text: &str) -> Result<Recording, CaseError> {
    let [clock_s, ax, ay, az, dx, dy, dz] =
        fixed(columns(file, text, &["clock_s", "ax_ng", "ay_ng", "az_ng", "dev_x_ng", "dev_y_ng", "dev_z_ng"])?);
    increasing(file, &clock_s, WINDOWS_MIN)?;
    Ok(Recording { clock_s, a_ng: [ax, ay, az], dev_ng: [dx, dy, dz], ..Recording::default() })
}

/// What a simulation expects.
pub fn simulation(file: &str, text: &str) -> Result<Simulation, CaseError> {
    let [clock_s, ax, ay, az] = fixed(columns(file, text, &["clock_s", "ax_ng", "ay_ng", "az_ng"])?);
    increasing(file, &clock_s, 2)?;
    Ok(Simulation { clock_s, a_ng: [ax, ay, az] })
}

/// Orbit, attitude and environment.
pub fn ancillary(file: &str, text: &str) -> Result<Ancillary, CaseError> {
    let names = [
        "clock_s",
        "rx_m",
        "ry_m",
        "rz_m",
        "vx_m_s",
        "vy_m_s",
        "vz_m_s",
        "qw",
        "qx",
        "qy",
        "qz",
        "wx_rad_s",
        "wy_rad_s",
        "wz_rad_s",
        "density_kg_m3",
        "temperature_c",
    ];
    let c = columns(file, text, &names)?;
    increasing(file, &c[0], 2)?;
    let rows = 0..c[0].len();
    let vector =
        |first: usize| rows.clone().map(|i| std::array::from_fn(|k| c[first + k][i])).collect::<Vec<[f64; 3]>>();
    let q = rows.clone().map(|i| std::array::from_fn(|k| c[7 + k][i])).collect();
    Ok(Ancillary {
        clock_s: c[0].clone(),
        r_m: vector(1),
        v_m_s: vector(4),
        q,
        w_rad_s: vector(11),
        density_kg_m3: c[14].clone(),
        temperature_c: c[15].clone(),
    })
}

/// No entry of a log lasts longer, s: a century.
const LONGEST_S: f64 = 3e9;

fn events(file: &str, text: &str) -> Result<Vec<Event>, CaseError> {
    let c = columns(file, text, &["clock_s", "duration_s"])?;
    let mut reader = table(text);
    let csv_error = |e: csv::Error| unread(file, &e);
    let header = reader.headers().map_err(csv_error)?.clone();
    let place = |name: &str| header.iter().position(|h| h == name);
    let kind = place("kind").ok_or_else(|| missing(file, "kind", &header))?;
    let detail = place("detail");
    let mut events = Vec::new();
    for (i, record) in reader.records().enumerate() {
        let record = record.map_err(csv_error)?;
        let duration_s = c[1][i];
        if duration_s < 0.0 {
            let (line, column, unit) = (i + 2, "duration_s".into(), "s");
            let file = file.into();
            return Err(CaseError::Beyond { file, line, column, found: duration_s, unit, low: 0.0, high: LONGEST_S });
        }
        events.push(Event {
            clock_s: c[0][i],
            duration_s,
            kind: record[kind].to_string(),
            detail: detail.and_then(|d| record.get(d)).unwrap_or_default().to_string(),
        });
    }
    Ok(events)
}

fn fixed<const N: usize>(columns: Vec<Vec<f64>>) -> [Vec<f64>; N] {
    let mut columns = columns.into_iter();
    std::array::from_fn(|_| columns.next().unwrap_or_default())
}
