//! Configuration: a TOML text in, checked values out, every fault told at once with its place and its value.
//!
//! Every key has a default, so an empty text is a whole configuration (STS-65, loopback only). Reading the configuration file is the
//! caller's; files it names are looked for here, so that a wrong path is among the faults, and read by [`diagnosis`].

pub mod diagnosis;
mod section;

use std::fmt;
use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::ingest::wire::LinkConfig;
use crate::pipeline::settings::Settings;
pub use diagnosis::DiagnosisConfig;
use section::Section;

/// Everything the service must be told, checked.
#[derive(Debug, Clone)]
pub struct Config {
    /// What the products depend on.
    pub settings: Settings,
    /// The port for dumps.
    pub ingest: IngestConfig,
    /// The port for people and programs.
    pub http: HttpConfig,
    /// Where the raw log and the recordings are kept.
    pub data_dir: PathBuf,
    /// Whether an MCAP recording is written as the data come in.
    pub recording: bool,
    /// What the recording is compared with as it comes in, if with anything.
    pub diagnosis: Option<DiagnosisConfig>,
}

/// The port for dumps.
#[derive(Debug, Clone)]
pub struct IngestConfig {
    /// Where to listen.
    pub address: SocketAddr,
    /// Who may send; empty: loopback only. The dump port knows no token.
    pub allow: Vec<IpAddr>,
    /// Connections at once: a permit each.
    pub connections_max: usize,
    /// A silent connection is closed after this, so that half a frame cannot hold a permit for ever.
    pub idle_timeout: Duration,
    /// How long a drain waits for what senders are still sending.
    pub drain_timeout: Duration,
}

/// The port for people and programs.
#[derive(Debug, Clone)]
pub struct HttpConfig {
    /// Where to listen.
    pub address: SocketAddr,
    /// Bearer token; needed for any address but loopback, unless `insecure`.
    pub token: Option<String>,
    /// Serve other addresses than loopback without a token.
    pub insecure: bool,
    /// WebSocket clients at once.
    pub live_clients_max: usize,
    /// Messages of a topic kept in memory for readers; older ones are read again from what they refer to.
    pub live_queue_messages: usize,
    /// A reader further behind than this many messages is told what it missed.
    pub live_behind_messages: usize,
}

/// One thing wrong with a configuration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Where: `http.address`.
    pub place: String,
    /// What, with the value found.
    pub sentence: String,
}

/// Everything wrong with a configuration.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct ConfigFaults(pub Vec<Fault>);

impl fmt::Display for ConfigFaults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.0.len() == 1 { "fault" } else { "faults" };
        write!(f, "the configuration has {} {plural}:", self.0.len())?;
        for fault in &self.0 {
            write!(f, "\n  {}: {}", fault.place, fault.sentence)?;
        }
        Ok(())
    }
}

impl Config {
    /// The defaults: STS-65, loopback only.
    pub fn standard() -> Self {
        Self::from_toml("").expect("the defaults have no faults")
    }

    /// Reads and checks a configuration.
    ///
    /// # Errors
    /// Every fault at once.
    pub fn from_toml(text: &str) -> Result<Self, ConfigFaults> {
        Self::from_toml_in(text, Path::new(""))
    }

    /// Reads and checks a configuration whose relative paths start in a folder: that of its file.
    ///
    /// # Errors
    /// Every fault at once.
    pub fn from_toml_in(text: &str, folder: &Path) -> Result<Self, ConfigFaults> {
        let table: toml::Table = match text.parse() {
            Ok(table) => table,
            Err(error) => {
                let sentence = error.to_string().trim_end().replace('\n', "\n    ");
                return Err(ConfigFaults(vec![Fault { place: "the file".into(), sentence }]));
            }
        };
        let mut faults = Vec::new();
        let mut root = Section::new("", table, &mut faults);
        let settings = settings(&mut root);
        let ingest = root.section("ingest", ingest);
        let http = root.section("http", http);
        let (data_dir, recording) = root.section("store", |section| {
            let dir = section.text("data").map_or_else(default_data_dir, PathBuf::from);
            (dir, section.flag("recording", true))
        });
        let diagnosis = root.section("diagnosis", |section| diagnosis::read(section, folder));
        root.finish();
        let config = Self { settings, ingest, http, data_dir, recording, diagnosis };
        faults.extend(config.exposure_faults());
        if faults.is_empty() { Ok(config) } else { Err(ConfigFaults(faults)) }
    }

    /// Addresses beyond loopback that nothing protects; checked again after the command line has changed an address.
    pub fn exposure_faults(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        let http = &self.http;
        if !http.address.ip().is_loopback() && http.token.is_none() && !http.insecure {
            let sentence = format!(
                "{} is not a loopback address, so it needs http.token (or http.insecure = true, open to whoever reaches it)",
                http.address
            );
            faults.push(Fault { place: "http.address".into(), sentence });
        }
        let ingest = &self.ingest;
        if !ingest.address.ip().is_loopback() && ingest.allow.is_empty() && !http.insecure {
            let sentence = format!(
                "{} is not a loopback address, so it needs ingest.allow, the addresses that may send (or http.insecure = true)",
                ingest.address
            );
            faults.push(Fault { place: "ingest.address".into(), sentence });
        }
        faults
    }
}

/// `data` under the user's data directory, or beside the program where there is none.
fn default_data_dir() -> PathBuf {
    directories::ProjectDirs::from("", "", "oare-ground")
        .map_or_else(|| PathBuf::from("oare-data"), |dirs| dirs.data_dir().to_path_buf())
}

fn settings(root: &mut Section<'_>) -> Settings {
    let mut settings = Settings::sts65();
    root.section("mission", |section| {
        if let Some(name) = section.text("name") {
            let fits = !name.is_empty() && name.len() <= 64 && !name.contains('\0');
            section
                .check("name", fits, || format!("{name:?} has {} octets; a mission has a name of 1 to 64", name.len()));
            settings.mission = name;
        }
        if let Some(epoch) = section.text("epoch_utc") {
            match epoch.parse() {
                Ok(epoch) => settings.time.epoch_utc = epoch,
                Err(_) => {
                    section.fault("epoch_utc", format!("{epoch:?} is no RFC 3339 time, such as 1994-07-08T12:53:01Z"))
                }
            }
        }
        settings.time.liftoff_clock_s = section.number("liftoff_clock_s", settings.time.liftoff_clock_s, 0.0..=4.0e9);
    });
    settings.link = root.section("link", |section| {
        let standard = LinkConfig::default();
        let interleave = section.integer("reed_solomon_interleave", 0, 0..=8) as usize;
        let link = LinkConfig {
            spacecraft_id: section.integer("spacecraft_id", i64::from(standard.spacecraft_id), 0..=0x3ff) as u16,
            frame_octets: section.integer("frame_octets", standard.frame_octets as i64, 1..=1 << 20) as usize,
            randomised: section.flag("randomised", standard.randomised),
            reed_solomon_interleave: (interleave > 0).then_some(interleave),
        };
        link.faults().into_iter().for_each(|fault| section.fault_here(fault.to_string()));
        link
    });
    root.section("instrument", |section| {
        let instrument = &mut settings.instrument;
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            section.numbers(&format!("resolution_{name}_ng"), &mut instrument.resolution_ng[axis], 1e-3..=1e6);
            section.numbers(&format!("scale_correction_{name}"), &mut instrument.scale_correction[axis], 0.1..=10.0);
        }
        instrument.scale_correction_sigma =
            section.number("scale_correction_sigma", instrument.scale_correction_sigma, 0.0..=1.0);
        section.numbers("radius_m", &mut instrument.radius_m, 0.001..=10.0);
        section.numbers("full_scale_a_ng", &mut instrument.full_scale_a_ng, 1.0..=1e9);
        instrument.systematic_bias_ng = section.number("systematic_bias_ng", instrument.systematic_bias_ng, 0.0..=1e6);
        instrument.systematic_scale = section.number("systematic_scale", instrument.systematic_scale, 0.0..=1.0);
    });
    root.section("window", |section| {
        let window = &mut settings.window;
        window.samples_min = section.integer("samples_min", window.samples_min as i64, 2..=500) as usize;
        window.correlated_samples = section.number("correlated_samples", window.correlated_samples, 1.0..=500.0);
    });
    settings
}

fn ingest(section: &mut Section<'_>) -> IngestConfig {
    IngestConfig {
        address: section
            .parsed("address", "an address and port, such as 127.0.0.1:7650")
            .unwrap_or(SocketAddr::from(([127, 0, 0, 1], 7650))),
        allow: section.parsed_list("allow", "an IP address"),
        connections_max: section.integer("connections_max", 16, 1..=4096) as usize,
        idle_timeout: section.seconds("idle_timeout_s", 30.0, 0.1..=86_400.0),
        drain_timeout: section.seconds("drain_timeout_s", 5.0, 0.0..=600.0),
    }
}

fn http(section: &mut Section<'_>) -> HttpConfig {
    let token = section.text("token");
    if let Some(token) = &token {
        let fits = token.len() >= 16 && token.bytes().all(|octet| octet.is_ascii_graphic());
        let length = token.len();
        section.check("token", fits, || {
            format!("it has {length} octets; a token has 16 or more, printable ASCII without spaces")
        });
    }
    HttpConfig {
        address: section
            .parsed("address", "an address and port, such as 127.0.0.1:8080")
            .unwrap_or(SocketAddr::from(([127, 0, 0, 1], 8080))),
        token,
        insecure: section.flag("insecure", false),
        live_clients_max: section.integer("live_clients_max", 1024, 1..=100_000) as usize,
        live_queue_messages: section.integer("live_queue_messages", 16_384, 16..=1 << 20) as usize,
        live_behind_messages: section.integer("live_behind_messages", 1 << 20, 16..=1 << 32) as usize,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_said_is_sts65_on_loopback() {
        let config = Config::standard();
        assert_eq!(config.settings, Settings::sts65());
        assert_eq!(config.ingest.address.to_string(), "127.0.0.1:7650");
        assert_eq!(config.http.address.to_string(), "127.0.0.1:8080");
    }

    #[test]
    fn all_faults_are_told_at_once_with_place_and_value() {
        let text = r#"
            speling = 1
            [mission]
            epoch_utc = "yesterday"
            [link]
            frame_octets = 4000
            spacecraft_id = "x"
            [ingest]
            idle_timeout_s = -1
            allow = ["10.0.0.1", "ten"]
            [http]
            address = "0.0.0.0:80"
            tokn = "secret"
            [diagnosis]
            simulation = "no/simulation.csv"
            claim_probability = 2
            without = ["drag"]
        "#;
        let faults = Config::from_toml(text).unwrap_err();
        let places: Vec<&str> = faults.0.iter().map(|fault| fault.place.as_str()).collect();
        let expected = [
            "mission.epoch_utc",
            "link.spacecraft_id",
            "link",
            "ingest.allow",
            "ingest.idle_timeout_s",
            "http.tokn",
            "diagnosis.simulation",
            "diagnosis.ancillary",
            "diagnosis.claim_probability",
            "diagnosis.without",
            "speling",
            "http.address",
        ];
        assert_eq!(places, expected);
        let told = faults.to_string();
        for value in ["\"yesterday\"", "4000", "\"x\"", "-1", "\"ten\"", "0.0.0.0:80", "no/simulation.csv", "\"drag\""]
        {
            assert!(told.contains(value), "{value} is not in: {told}");
        }
    }

    /// Whoever writes the table wants a running diagnosis.
    #[test]
    fn an_empty_diagnosis_is_a_fault_and_an_absent_one_is_none() {
        let faults = Config::from_toml("[diagnosis]").unwrap_err();
        let places: Vec<&str> = faults.0.iter().map(|fault| fault.place.as_str()).collect();
        assert_eq!(places, ["diagnosis.simulation", "diagnosis.ancillary"]);
        assert!(Config::from_toml("").unwrap().diagnosis.is_none());
    }

    #[test]
    fn an_open_address_needs_a_token_and_an_allow_list_or_a_word_for_it() {
        let open = "[http]\naddress = \"0.0.0.0:8080\"\n";
        assert!(Config::from_toml(open).is_err());
        assert!(Config::from_toml(&format!("{open}token = \"0123456789abcdef\"")).is_ok());
        assert!(Config::from_toml(&format!("{open}insecure = true")).is_ok());
        let ingest = "[ingest]\naddress = \"0.0.0.0:7650\"\n";
        assert!(Config::from_toml(ingest).is_err());
        assert!(Config::from_toml(&format!("{ingest}allow = [\"192.0.2.7\"]")).is_ok());
    }
}
