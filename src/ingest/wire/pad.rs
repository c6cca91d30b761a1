//! A PAD file, as the archive of microgravity measurements on the space station (PIMS) keeps them: an XML header beside a
//! file of 32-bit floats, four to a sample (time since `TimeZero` in seconds, x, y, z in g).
//!
//! Not here: files (bytes and text come in), and the writer.

use std::fmt::Write;

use thiserror::Error;

/// One sample in the file: time, x, y, z.
const SAMPLE_BYTES: usize = 16;

/// A PAD file that cannot be used.
#[derive(Debug, Error, PartialEq)]
pub enum PadError {
    /// The header is no XML.
    #[error("PAD header: {0}")]
    Xml(String),
    /// An element of the header is missing, or is not what it should be.
    #[error("PAD header: expected {expected} in <{element}>, found {found:?}")]
    Element {
        /// Its name.
        element: &'static str,
        /// What belongs there.
        expected: &'static str,
        /// What was there.
        found: String,
    },
    /// The data are not whole samples.
    #[error(
        "PAD data: expected a multiple of {SAMPLE_BYTES} bytes (time, x, y, z as 32-bit floats), found {found} bytes"
    )]
    Length {
        /// Bytes there.
        found: usize,
    },
    /// There are no data.
    #[error("PAD data: there is no sample")]
    Empty,
    /// A sample is not four finite numbers, or time runs backwards.
    #[error("PAD data, sample {sample}: expected {expected}, found {found}")]
    Sample {
        /// Number of the sample, from 0.
        sample: usize,
        /// What belongs there.
        expected: &'static str,
        /// What was there.
        found: String,
    },
}

/// What the header says, as far as the samples need it.
#[derive(Debug, Clone, PartialEq)]
pub struct PadHeader {
    /// Sensor, such as `121f03006`.
    pub sensor: String,
    /// Instant of time zero, such as `2014_10_22_09_36_36.324` (UTC).
    pub time_zero: String,
    /// Samples a second.
    pub rate_hz: f64,
    /// Cutoff frequency of the low-pass filter, Hz.
    pub cutoff_hz: f64,
    /// Gain.
    pub gain: f64,
    /// What the coordinates are fixed to, as the header names it.
    pub coordinates: String,
    /// What was done to the data, as the header puts it.
    pub quality: String,
    big_endian: bool,
}

/// One sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PadSample {
    /// Time since time zero, s.
    pub t_s: f32,
    /// Acceleration, g.
    pub a_g: [f32; 3],
}

/// A file read.
#[derive(Debug, Clone, PartialEq)]
pub struct Pad {
    /// Its header.
    pub header: PadHeader,
    /// Its samples, in the order of time.
    pub samples: Vec<PadSample>,
}

impl PadHeader {
    /// From the header's text.
    pub fn parse(xml: &str) -> Result<Self, PadError> {
        let document = roxmltree::Document::parse(xml).map_err(|e| PadError::Xml(e.to_string()))?;
        let node = |name: &str| document.descendants().find(|n| n.has_tag_name(name));
        let text = |name: &str| node(name).and_then(|n| n.text()).unwrap_or_default().trim().to_owned();
        let number = |element: &'static str| {
            let found = text(element);
            match found.parse::<f64>() {
                Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
                _ => Err(PadError::Element { element, expected: "a number above zero", found }),
            }
        };
        let format = node("GData").and_then(|n| n.attribute("format")).unwrap_or_default().to_owned();
        if !format.contains("32 bit") || !format.contains("float") {
            let expected = "32-bit IEEE floats as the format";
            return Err(PadError::Element { element: "GData", expected, found: format });
        }
        let system = node("DataCoordinateSystem");
        let of = |name: &str| system.and_then(|n| n.attribute(name)).unwrap_or_default();
        Ok(Self {
            sensor: text("SensorID"),
            time_zero: text("TimeZero"),
            rate_hz: number("SampleRate")?,
            cutoff_hz: number("CutoffFreq")?,
            gain: number("Gain")?,
            coordinates: [of("name"), of("comment")].join(" ").trim().to_owned(),
            quality: text("DataQualityMeasure"),
            big_endian: format.contains("big endian"),
        })
    }
}

impl Pad {
    /// From the header's text and the data's bytes.
    pub fn read(xml: &str, data: &[u8]) -> Result<Self, PadError> {
        let header = PadHeader::parse(xml)?;
        if data.is_empty() {
            return Err(PadError::Empty);
        }
        if !data.len().is_multiple_of(SAMPLE_BYTES) {
            return Err(PadError::Length { found: data.len() });
        }
        let mut samples: Vec<PadSample> = Vec::with_capacity(data.len() / SAMPLE_BYTES);
        for (sample, bytes) in data.chunks_exact(SAMPLE_BYTES).enumerate() {
            let [t_s, x, y, z] = std::array::from_fn(|k| {
                let four = [bytes[4 * k], bytes[4 * k + 1], bytes[4 * k + 2], bytes[4 * k + 3]];
                if header.big_endian { f32::from_be_bytes(four) } else { f32::from_le_bytes(four) }
            });
            let bad = |expected, found: String| PadError::Sample { sample, expected, found };
            if ![t_s, x, y, z].iter().all(|v| v.is_finite()) {
                return Err(bad("four finite numbers", format!("{t_s}, {x}, {y}, {z}")));
            }
            if let Some(before) = samples.last().filter(|before| before.t_s >= t_s) {
                return Err(bad("a time after the one before", format!("{t_s} after {}", before.t_s)));
            }
            samples.push(PadSample { t_s, a_g: [x, y, z] });
        }
        Ok(Self { header, samples })
    }

    /// Mean of each axis, g.
    pub fn mean_g(&self) -> [f64; 3] {
        let n = self.samples.len().max(1) as f64;
        std::array::from_fn(|k| self.samples.iter().map(|s| f64::from(s.a_g[k])).sum::<f64>() / n)
    }

    /// Rms of each axis about its mean, g.
    pub fn rms_g(&self) -> [f64; 3] {
        let (n, mean) = (self.samples.len().max(1) as f64, self.mean_g());
        let square = |k: usize| self.samples.iter().map(|s| (f64::from(s.a_g[k]) - mean[k]).powi(2)).sum::<f64>();
        std::array::from_fn(|k| (square(k) / n).sqrt())
    }

    /// As CSV: `t_s,x_g,y_g,z_g`.
    pub fn csv(&self) -> String {
        let mut out = String::from("t_s,x_g,y_g,z_g\n");
        for PadSample { t_s, a_g: [x, y, z] } in &self.samples {
            let _ = writeln!(out, "{t_s},{x:e},{y:e},{z:e}");
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(format: &str) -> String {
        format!(
            "<?xml version=\"1.0\"?><sams2_accel><SensorID>121f03</SensorID><TimeZero>2014_10_22_09_36_36.324</TimeZero>\
             <Gain>10.0</Gain><SampleRate>142.00</SampleRate><CutoffFreq>6.00</CutoffFreq>\
             <GData file=\"a\" format=\"{format}\"/><DataCoordinateSystem name=\"SSAnalysis\" comment=\"S0\"/></sams2_accel>"
        )
    }

    const LITTLE: &str = "binary 32 bit IEEE float little endian";

    fn bytes(values: &[f32]) -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    #[test]
    fn samples_come_in_quadruples() {
        let pad = Pad::read(&header(LITTLE), &bytes(&[0.0, 1e-6, 2e-6, 3e-6, 0.5, -1e-6, 0.0, 1e-6])).unwrap();
        assert_eq!(pad.samples[1], PadSample { t_s: 0.5, a_g: [-1e-6, 0.0, 1e-6] });
        assert_eq!((pad.header.rate_hz, pad.header.coordinates.as_str()), (142.0, "SSAnalysis S0"));
        assert_eq!(pad.csv().lines().nth(2), Some("0.5,-1e-6,0e0,1e-6"));
    }

    #[test]
    fn the_other_byte_order_is_read_when_the_header_says_so() {
        let data: Vec<u8> = [0.25_f32, 1.0, 2.0, 3.0].iter().flat_map(|v| v.to_be_bytes()).collect();
        let pad = Pad::read(&header("binary 32 bit IEEE float big endian"), &data).unwrap();
        assert_eq!(pad.samples, [PadSample { t_s: 0.25, a_g: [1.0, 2.0, 3.0] }]);
    }

    #[test]
    fn what_is_broken_is_told_with_its_place() {
        let said = |xml: &str, data: &[u8]| Pad::read(xml, data).unwrap_err().to_string();
        assert_eq!(
            said(&header(LITTLE), &[0; 15]),
            "PAD data: expected a multiple of 16 bytes (time, x, y, z as 32-bit floats), found 15 bytes"
        );
        assert_eq!(
            said(&header(LITTLE), &bytes(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])),
            "PAD data, sample 1: expected a time after the one before, found 0 after 0"
        );
        assert!(said(&header(LITTLE), &bytes(&[0.0, f32::NAN, 0.0, 0.0])).contains("sample 0: expected four finite"));
        assert!(said(&header("text"), &[]).contains("expected 32-bit IEEE floats"));
        assert!(said(&header(LITTLE).replace("142.00", "fast"), &[]).contains("<SampleRate>, found \"fast\""));
        assert_eq!(said(&header(LITTLE), &[]), "PAD data: there is no sample");
        assert!(said("not xml", &[]).starts_with("PAD header: "));
    }
}
