//! A case, read from its texts and checked. Not here: files (the command reads them), and what other kinds of recording hold.

use std::ops::Deref;
use std::sync::Arc;

use jiff::Timestamp;

use super::error::CaseError;

/// Windows a recording must have in common with its simulation, fewer say nothing about the noise.
pub const WINDOWS_MIN: usize = 200;
/// Half of the window the recorder averages over, s.
pub const HALF_WINDOW_S: f64 = 25.0;
/// From the centre of one window to that of the next, s.
pub const WINDOW_STRIDE_S: f64 = 25.0;

/// `case.toml`, checked. What other kinds add stays in `table`.
#[derive(Debug, Clone)]
pub struct Header {
    /// The case's id.
    pub id: String,
    /// UTC at instrument clock 0.
    pub epoch_utc: Timestamp,
    /// Lift-off, instrument clock.
    pub liftoff_clock_s: f64,
    /// Span asked for, instrument clock.
    pub span_s: [f64; 2],
    /// The vehicle.
    pub vehicle: Vehicle,
    /// Physics the simulation claims to include: tested, not believed.
    pub includes: Vec<String>,
    /// Kind of recording.
    pub kind: String,
    /// File names: recording, simulation, ancillary, events.
    pub files: Files,
    /// Everything `case.toml` said.
    pub table: toml::Table,
}

/// Names of the files of a case, as `case.toml` gives them; empty where it gives none.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Files {
    /// Recording.
    pub recording: String,
    /// Simulation.
    pub simulation: String,
    /// Ancillary data.
    pub ancillary: String,
    /// Mission log.
    pub events: String,
}

/// The vehicle as the simulation knows it.
#[derive(Debug, Clone, PartialEq)]
pub struct Vehicle {
    /// Mass.
    pub mass_kg: f64,
    /// Drag coefficient.
    pub drag_coefficient: f64,
    /// Projected area along body X, Y, Z.
    pub area_m2: [f64; 3],
    /// Sensor from the centre of gravity, body axes.
    pub sensor_offset_m: [f64; 3],
    /// Solar radiation coefficient.
    pub srp_coefficient: f64,
}

/// The texts of the files a case names.
#[derive(Debug, Clone, Default)]
pub struct Texts {
    /// `recording.csv`.
    pub recording: Option<String>,
    /// `simulation.csv`.
    pub simulation: Option<String>,
    /// `ancillary.csv`.
    pub ancillary: Option<String>,
    /// `events.csv`; a case without a log is allowed.
    pub events: Option<String>,
}

/// Calibrated windows.
#[derive(Debug, Clone, Default)]
pub struct Recording {
    /// Window centres, increasing.
    pub clock_s: Vec<f64>,
    /// Acceleration in body axes, one vector per axis.
    pub a_ng: [Vec<f64>; 3],
    /// Average deviation in the window.
    pub dev_ng: [Vec<f64>; 3],
}

/// What the baseline simulation expects, instantaneous.
#[derive(Debug, Clone, Default)]
pub struct Simulation {
    /// Grid, increasing.
    pub clock_s: Vec<f64>,
    /// Acceleration in body axes, one vector per axis.
    pub a_ng: [Vec<f64>; 3],
}

/// Orbit, attitude and environment on their grid.
#[derive(Debug, Clone, Default)]
pub struct Ancillary {
    /// Grid, increasing.
    pub clock_s: Vec<f64>,
    /// Inertial position (true equator of date).
    pub r_m: Vec<[f64; 3]>,
    /// Inertial velocity.
    pub v_m_s: Vec<[f64; 3]>,
    /// Body from inertial, scalar first.
    pub q: Vec<[f64; 4]>,
    /// Inertial rate in body axes.
    pub w_rad_s: Vec<[f64; 3]>,
    /// Density the simulation used.
    pub density_kg_m3: Vec<f64>,
    /// Sensor temperature.
    pub temperature_c: Vec<f64>,
}

/// One entry of the mission log.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Start, instrument clock.
    pub clock_s: f64,
    /// Duration.
    pub duration_s: f64,
    /// Kind.
    pub kind: String,
    /// Anything.
    pub detail: String,
}

/// What a recording is compared with, checked: a case that lacks its recording.
#[derive(Debug, Clone)]
pub struct Expectation {
    /// `case.toml`.
    pub header: Header,
    /// The simulation.
    pub simulation: Simulation,
    /// The ancillary data.
    pub ancillary: Ancillary,
    /// The mission log, in order of time.
    pub events: Vec<Event>,
}

/// A checked `acceleration_csv` case: every window lies inside simulation and ancillary data.
#[derive(Debug, Clone)]
pub struct Case {
    /// What the recording is compared with.
    pub expected: Arc<Expectation>,
    /// The recording.
    pub recording: Recording,
    /// Windows left out because the simulation's grid is too coarse for its own signal there.
    pub windows_too_rough: usize,
}

impl Deref for Case {
    type Target = Expectation;

    fn deref(&self) -> &Expectation {
        &self.expected
    }
}

impl Header {
    /// Parse `case.toml`; `set` are `key=value` overrides of dotted keys.
    pub fn parse(text: &str, set: &[String]) -> Result<Self, CaseError> {
        let mut table: toml::Table =
            text.parse().map_err(|e: toml::de::Error| CaseError::Toml(one_line(&e.to_string())))?;
        for item in set {
            override_key(&mut table, item)?;
        }
        let kind = string(&table, "recording.kind")?;
        let vehicle = Vehicle {
            mass_kg: number_or(&table, "vehicle.mass_kg", 104_000.0)?,
            drag_coefficient: number_or(&table, "vehicle.drag_coefficient", 2.2)?,
            area_m2: triple_or(&table, "vehicle.area_m2", [64.1, 255.0, 367.0])?,
            sensor_offset_m: triple_or(&table, "vehicle.sensor_offset_m", [0.0; 3])?,
            srp_coefficient: number_or(&table, "vehicle.srp_coefficient", 1.3)?,
        };
        let epoch = string(&table, "case.epoch_utc")
            .or_else(|e| if kind == "acceleration_csv" { Err(e) } else { Ok("1970-01-01T00:00:00Z".into()) })?;
        let epoch_utc = epoch.parse().map_err(|_| CaseError::Key {
            key: "case.epoch_utc".into(),
            expected: "a UTC time such as 1994-07-08T12:53:01Z",
            found: epoch,
        })?;
        if vehicle.mass_kg <= 0.0 {
            return Err(CaseError::Key {
                key: "vehicle.mass_kg".into(),
                expected: "positive",
                found: vehicle.mass_kg.to_string(),
            });
        }
        Ok(Self {
            id: string(&table, "case.id")?,
            epoch_utc,
            liftoff_clock_s: number_or(&table, "case.liftoff_clock_s", 0.0)?,
            span_s: [
                number_or(&table, "case.start_s", f64::NEG_INFINITY)?,
                number_or(&table, "case.end_s", f64::INFINITY)?,
            ],
            vehicle,
            includes: words(&table, "simulation.includes"),
            kind,
            files: Files {
                recording: string(&table, "recording.file").unwrap_or_default(),
                simulation: string(&table, "simulation.file").unwrap_or_default(),
                ancillary: string(&table, "ancillary.file").unwrap_or_default(),
                events: string(&table, "ancillary.events").unwrap_or_default(),
            },
            table,
        })
    }

    /// Unix time of an instrument clock.
    pub fn unix_s(&self, clock_s: f64) -> f64 {
        self.epoch_utc.as_millisecond() as f64 / 1000.0 + clock_s
    }
}

impl Expectation {
    /// From its parts, units checked.
    ///
    /// # Errors
    /// The first unit that cannot be right.
    pub fn new(
        header: Header,
        simulation: Simulation,
        ancillary: Ancillary,
        mut events: Vec<Event>,
    ) -> Result<Self, CaseError> {
        check_simulation(&header.files.simulation, &simulation)?;
        check_ancillary(&header.files.ancillary, &ancillary)?;
        events.sort_by(|a, b| a.clock_s.total_cmp(&b.clock_s));
        Ok(Self { header, simulation, ancillary, events })
    }

    /// From the texts of its files, of which a recording is not one.
    ///
    /// # Errors
    /// What is wrong with each of the files.
    pub fn from_texts(header: Header, texts: &Texts) -> Result<Self, Vec<CaseError>> {
        let files = &header.files;
        let simulation = given(&files.simulation, &texts.simulation)
            .and_then(|text| parse_simulation(&files.simulation, text))
            .and_then(|simulation| check_simulation(&files.simulation, &simulation).map(|()| simulation));
        let ancillary = given(&files.ancillary, &texts.ancillary)
            .and_then(|text| parse_ancillary(&files.ancillary, text))
            .and_then(|ancillary| check_ancillary(&files.ancillary, &ancillary).map(|()| ancillary));
        let events = parse_log(&files.events, &texts.events);
        match (simulation, ancillary, events) {
            (Ok(simulation), Ok(ancillary), Ok(events)) => {
                Self::new(header, simulation, ancillary, events).map_err(|error| vec![error])
            }
            (simulation, ancillary, events) => {
                Err([simulation.err(), ancillary.err(), events.err()].into_iter().flatten().collect())
            }
        }
    }

    /// Events of one kind as spans `[start_s, end_s]`.
    pub fn spans(&self, kind: &str) -> Vec<[f64; 2]> {
        self.events.iter().filter(|e| e.kind == kind).map(|e| [e.clock_s, e.clock_s + e.duration_s]).collect()
    }
}

impl Case {
    /// From the texts of its files.
    pub fn from_texts(header: Header, texts: &Texts) -> Result<Self, CaseError> {
        let name = header.files.recording.clone();
        let recording = parse_recording(&name, given(&name, &texts.recording)?)?;
        let expected = Expectation::from_texts(header, texts).map_err(first)?;
        Self::meet(Arc::new(expected), recording)
    }

    /// From its parts: units checked, and windows outside simulation, ancillary data or the span asked for left out.
    pub fn new(
        header: Header,
        recording: Recording,
        simulation: Simulation,
        ancillary: Ancillary,
        events: Vec<Event>,
    ) -> Result<Self, CaseError> {
        Self::meet(Arc::new(Expectation::new(header, simulation, ancillary, events)?), recording)
    }

    /// A recording and what it is compared with: its unit checked, and windows outside simulation, ancillary data or the span
    /// asked for left out.
    ///
    /// # Errors
    /// When the unit cannot be right, or too little is in common.
    pub fn meet(expected: Arc<Expectation>, recording: Recording) -> Result<Self, CaseError> {
        let files = &expected.header.files;
        check_recording(&files.recording, &recording)?;
        let common = |grid: &[f64]| [grid[0] + HALF_WINDOW_S, grid[grid.len() - 1] - HALF_WINDOW_S];
        let mut kept = recording;
        for (file, span) in [
            ("case.toml", expected.header.span_s),
            (&files.simulation, common(&expected.simulation.clock_s)),
            (&files.ancillary, common(&expected.ancillary.clock_s)),
        ] {
            let [first, last] = [kept.clock_s[0], kept.clock_s[kept.clock_s.len() - 1]];
            kept = within(&kept, span);
            if kept.clock_s.len() < WINDOWS_MIN {
                return Err(CaseError::NoOverlap {
                    recording_start_s: first,
                    recording_end_s: last,
                    file: file.to_string(),
                    start_s: span[0],
                    end_s: span[1],
                    common: kept.clock_s.len(),
                    needed: WINDOWS_MIN,
                });
            }
        }
        let before = kept.clock_s.len();
        let smooth = smooth_enough(&kept, &expected.simulation);
        if smooth.clock_s.len() >= WINDOWS_MIN {
            kept = smooth;
        }
        let windows_too_rough = before - kept.clock_s.len();
        Ok(Self { expected, recording: kept, windows_too_rough })
    }
}

/// The text of a file the case names.
fn given<'a>(file: &str, text: &'a Option<String>) -> Result<&'a str, CaseError> {
    text.as_deref().ok_or_else(|| CaseError::MissingFile { file: file.to_string() })
}

fn parse_log(file: &str, text: &Option<String>) -> Result<Vec<Event>, CaseError> {
    match text {
        Some(text) => parse_events(file, text),
        None if file.is_empty() => Ok(Vec::new()),
        None => Err(CaseError::MissingFile { file: file.to_string() }),
    }
}

fn first(mut errors: Vec<CaseError>) -> CaseError {
    errors.swap_remove(0)
}

fn within(recording: &Recording, span: [f64; 2]) -> Recording {
    let keep: Vec<usize> = (0..recording.clock_s.len())
        .filter(|&i| recording.clock_s[i] >= span[0] && recording.clock_s[i] <= span[1])
        .collect();
    take(recording, &keep)
}

fn take(recording: &Recording, keep: &[usize]) -> Recording {
    let pick = |v: &Vec<f64>| keep.iter().map(|&i| v[i]).collect::<Vec<f64>>();
    Recording {
        clock_s: pick(&recording.clock_s),
        a_ng: std::array::from_fn(|k| pick(&recording.a_ng[k])),
        dev_ng: std::array::from_fn(|k| pick(&recording.dev_ng[k])),
    }
}

/// Share of the noise by which a straight line between grid points may miss the simulated signal.
const ROUGHNESS_MAX: f64 = 0.3;

/// The windows in which the simulation's grid resolves its own signal: between grid points it is known to about an eighth
/// of the second difference, and where that is not small against the noise a comparison says nothing.
fn smooth_enough(recording: &Recording, simulation: &Simulation) -> Recording {
    let grid = &simulation.clock_s;
    let noise: [f64; 3] = std::array::from_fn(|k| {
        let mut steps: Vec<f64> = recording.a_ng[k].windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        steps.sort_by(f64::total_cmp);
        steps[steps.len() / 2].max(1e-9)
    });
    let rough: Vec<bool> = (0..grid.len())
        .map(|i| {
            let [a, b] = [i.saturating_sub(1), (i + 1).min(grid.len() - 1)];
            (0..3).any(|k| {
                let m = &simulation.a_ng[k];
                (m[a] - 2.0 * m[i] + m[b]).abs() / 8.0 > ROUGHNESS_MAX * noise[k]
            })
        })
        .collect();
    let touched = |t: f64| {
        let first = grid.partition_point(|g| *g < t - HALF_WINDOW_S).saturating_sub(1);
        let last = (grid.partition_point(|g| *g < t + HALF_WINDOW_S) + 1).min(grid.len());
        rough[first..last].iter().any(|r| *r)
    };
    let keep: Vec<usize> = (0..recording.clock_s.len()).filter(|i| !touched(recording.clock_s[*i])).collect();
    take(recording, &keep)
}

/// Columns of accelerations.
const ACCELERATION: [&str; 3] = ["ax_ng", "ay_ng", "az_ng"];

fn check_recording(file: &str, recording: &Recording) -> Result<(), CaseError> {
    if recording.clock_s.len() < WINDOWS_MIN {
        return Err(CaseError::TooFew { file: file.into(), found: recording.clock_s.len(), needed: WINDOWS_MIN });
    }
    for k in 0..3 {
        typical(file, ACCELERATION[k], &recording.a_ng[k], "ng", 1e-2, 1e7)?;
        typical(file, ["dev_x_ng", "dev_y_ng", "dev_z_ng"][k], &recording.dev_ng[k], "ng", 1e-3, 1e7)?;
    }
    Ok(())
}

fn check_simulation(file: &str, simulation: &Simulation) -> Result<(), CaseError> {
    (0..3).try_for_each(|k| typical(file, ACCELERATION[k], &simulation.a_ng[k], "ng", 1e-6, 1e7))
}

fn check_ancillary(file: &str, ancillary: &Ancillary) -> Result<(), CaseError> {
    let norm = |v: &[[f64; 3]]| v.iter().map(|x| x.iter().map(|c| c * c).sum::<f64>().sqrt()).collect::<Vec<f64>>();
    typical(file, "rx_m, ry_m, rz_m", &norm(&ancillary.r_m), "m", 6.4e6, 5e7)?;
    typical(file, "vx_m_s, vy_m_s, vz_m_s", &norm(&ancillary.v_m_s), "m/s", 5e2, 1.2e4)?;
    typical(file, "wx_rad_s, wy_rad_s, wz_rad_s", &norm(&ancillary.w_rad_s), "rad/s", 0.0, 1.0)?;
    typical(file, "density_kg_m3", &ancillary.density_kg_m3, "kg/m3", 0.0, 1e-6)?;
    typical(file, "temperature_c", &ancillary.temperature_c, "C", 0.0, 500.0)?;
    let q: Vec<f64> = ancillary.q.iter().map(|q| q.iter().map(|c| c * c).sum::<f64>().sqrt()).collect();
    typical(file, "qw, qx, qy, qz (norm)", &q, "1, the norm", 0.99, 1.01)
}

fn typical(file: &str, column: &str, values: &[f64], unit: &'static str, low: f64, high: f64) -> Result<(), CaseError> {
    let mut sizes: Vec<f64> = values.iter().map(|v| v.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let found = sizes[sizes.len() / 2];
    if found < low || found > high {
        return Err(CaseError::Unit { file: file.into(), column: column.into(), found, unit, low, high });
    }
    Ok(())
}

/// Columns of a CSV by name, every cell a finite number.
fn columns(file: &str, text: &str, names: &[&str]) -> Result<Vec<Vec<f64>>, CaseError> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let csv_error = |e: csv::Error| CaseError::Csv { file: file.into(), reason: one_line(&e.to_string()) };
    let header = reader.headers().map_err(csv_error)?.clone();
    let places = names.iter().map(|name| {
        header.iter().position(|h| h == *name).ok_or_else(|| CaseError::MissingColumn {
            file: file.into(),
            column: name.to_string(),
            found: header.iter().collect::<Vec<_>>().join(", "),
        })
    });
    let places = places.collect::<Result<Vec<usize>, _>>()?;
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

fn increasing(file: &str, clock_s: &[f64], needed: usize) -> Result<(), CaseError> {
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

fn parse_recording(file: &str, text: &str) -> Result<Recording, CaseError> {
    let [clock_s, ax, ay, az, dx, dy, dz] =
        fixed(columns(file, text, &["clock_s", "ax_ng", "ay_ng", "az_ng", "dev_x_ng", "dev_y_ng", "dev_z_ng"])?);
    increasing(file, &clock_s, WINDOWS_MIN)?;
    Ok(Recording { clock_s, a_ng: [ax, ay, az], dev_ng: [dx, dy, dz] })
}

fn parse_simulation(file: &str, text: &str) -> Result<Simulation, CaseError> {
    let [clock_s, ax, ay, az] = fixed(columns(file, text, &["clock_s", "ax_ng", "ay_ng", "az_ng"])?);
    increasing(file, &clock_s, 2)?;
    Ok(Simulation { clock_s, a_ng: [ax, ay, az] })
}

fn parse_ancillary(file: &str, text: &str) -> Result<Ancillary, CaseError> {
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

fn parse_events(file: &str, text: &str) -> Result<Vec<Event>, CaseError> {
    let c = columns(file, text, &["clock_s", "duration_s"])?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let csv_error = |e: csv::Error| CaseError::Csv { file: file.into(), reason: one_line(&e.to_string()) };
    let header = reader.headers().map_err(csv_error)?.clone();
    let place = |name: &str| header.iter().position(|h| h == name);
    let kind = place("kind").ok_or_else(|| CaseError::MissingColumn {
        file: file.into(),
        column: "kind".into(),
        found: header.iter().collect::<Vec<_>>().join(", "),
    })?;
    let detail = place("detail");
    let mut events = Vec::new();
    for (i, record) in reader.records().enumerate() {
        let record = record.map_err(csv_error)?;
        events.push(Event {
            clock_s: c[0][i],
            duration_s: c[1][i].max(0.0),
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

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn lookup<'a>(table: &'a toml::Table, key: &str) -> Option<&'a toml::Value> {
    let mut parts = key.split('.');
    let mut value = table.get(parts.next()?)?;
    for part in parts {
        value = value.as_table()?.get(part)?;
    }
    Some(value)
}

fn wrong(key: &str, expected: &'static str, found: Option<&toml::Value>) -> CaseError {
    CaseError::Key { key: key.into(), expected, found: found.map_or("nothing".to_string(), |v| v.to_string()) }
}

fn string(table: &toml::Table, key: &str) -> Result<String, CaseError> {
    let value = lookup(table, key);
    value.and_then(|v| v.as_str()).map(str::to_string).ok_or_else(|| wrong(key, "a text", value))
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64)).filter(|x| x.is_finite())
}

fn number_or(table: &toml::Table, key: &str, default: f64) -> Result<f64, CaseError> {
    match lookup(table, key) {
        None => Ok(default),
        Some(value) => number(value).ok_or_else(|| wrong(key, "a finite number", Some(value))),
    }
}

fn triple_or(table: &toml::Table, key: &str, default: [f64; 3]) -> Result<[f64; 3], CaseError> {
    let Some(value) = lookup(table, key) else { return Ok(default) };
    let numbers: Option<Vec<f64>> = value.as_array().and_then(|a| a.iter().map(number).collect());
    numbers.and_then(|n| n.try_into().ok()).ok_or_else(|| wrong(key, "three finite numbers", Some(value)))
}

fn words(table: &toml::Table, key: &str) -> Vec<String> {
    lookup(table, key)
        .and_then(|v| v.as_array())
        .map(|a| a.iter().filter_map(|v| v.as_str().map(str::to_string)).collect())
        .unwrap_or_default()
}

fn override_key(table: &mut toml::Table, item: &str) -> Result<(), CaseError> {
    let bad = || CaseError::Key { key: item.into(), expected: "key=value", found: item.into() };
    let (key, value) = item.split_once('=').ok_or_else(bad)?;
    let value: toml::Value = format!("v = {value}")
        .parse::<toml::Table>()
        .ok()
        .and_then(|mut t| t.remove("v"))
        .unwrap_or_else(|| toml::Value::String(value.into()));
    let mut parts: Vec<&str> = key.trim().split('.').collect();
    let last = parts.pop().ok_or_else(bad)?;
    let mut place = table;
    for part in parts {
        place = place
            .entry(part)
            .or_insert_with(|| toml::Value::Table(toml::Table::new()))
            .as_table_mut()
            .ok_or_else(bad)?;
    }
    place.insert(last.into(), value);
    Ok(())
}
