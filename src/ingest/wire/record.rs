//! The packets of this instrument, read and written: science, housekeeping, table, event, on-board estimate.
//!
//! Big-endian, but for the 75-octet science record, which is little-endian as it is in the PIMS archive.

use jiff::civil;

use super::packet::{Apid, PacketId, PacketRefusal, SpacePacket};
use crate::telemetry::{
    AccRecord, Event, EventCode, Housekeeping, Mode, OnBoardEstimate, PrcAxis, Range, SAMPLES_PER_RECORD, Step,
    TableReport,
};

/// Octets of the science record.
pub const ACC_OCTETS: usize = 75;
/// Octets of the housekeeping data.
pub const HSK_OCTETS: usize = 16;
/// Octets of the table data.
pub const TBL_OCTETS: usize = 12;
/// Octets of an event before its text.
pub const EVT_OCTETS_MIN: usize = 7;
/// Octets of the on-board estimate.
pub const PRC_OCTETS: usize = 3 * 15;

/// One decoded packet.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// One second of science data.
    Acc(AccRecord),
    /// Housekeeping.
    Hsk(Housekeeping),
    /// Calibration table.
    Tbl(TableReport),
    /// Event.
    Evt(Event),
    /// On-board estimate.
    Prc(OnBoardEstimate),
}

impl Record {
    /// Reads the data of a packet by its APID.
    ///
    /// # Errors
    /// The first thing in it that makes no sense.
    pub fn read(packet: &SpacePacket<'_>) -> Result<Self, PacketRefusal> {
        match packet.id.apid {
            Apid::ACC => read_acc(packet.id, packet.data).map(Record::Acc),
            Apid::HSK => read_hsk(packet.id, packet.data).map(Record::Hsk),
            Apid::TBL => read_tbl(packet.id, packet.data).map(Record::Tbl),
            Apid::EVT => read_evt(packet.id, packet.data).map(Record::Evt),
            Apid::PRC => read_prc(packet.id, packet.data).map(Record::Prc),
            _ => Err(PacketRefusal::UnknownApid),
        }
    }
}

/// Data of exactly `N` octets.
fn exactly<const N: usize>(data: &[u8]) -> Result<&[u8; N], PacketRefusal> {
    data.try_into().map_err(|_| PacketRefusal::Length)
}

fn le_u16(octets: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([octets[at], octets[at + 1]])
}

fn be_u16(octets: &[u8], at: usize) -> u16 {
    u16::from_be_bytes([octets[at], octets[at + 1]])
}

fn be_u32(octets: &[u8], at: usize) -> u32 {
    u32::from_be_bytes([octets[at], octets[at + 1], octets[at + 2], octets[at + 3]])
}

/// Two decimal digits in one octet.
fn bcd(octet: u8) -> Option<i16> {
    let (tens, ones) = (octet >> 4, octet & 0x0f);
    (tens < 10 && ones < 10).then(|| i16::from(tens) * 10 + i16::from(ones))
}

/// The Orbiter's clock of a science record, in milliseconds since 1970-01-01 UTC.
///
/// 23:59:60 is read as a leap second: one second after 23:59:59.
fn orbiter_unix_ms(octets: &[u8]) -> Option<i64> {
    let mut fields = [0i16; 7];
    for (field, octet) in fields.iter_mut().zip(octets) {
        *field = bcd(*octet)?;
    }
    let [century, year, month, day, hour, minute, second] = fields;
    let millisecond = i64::from(le_u16(octets, 8));
    let leap = i64::from(second == 60 && minute == 59 && hour == 23);
    let second = second - leap as i16;
    let date = civil::Date::new(century * 100 + year, month as i8, day as i8).ok()?;
    let time = civil::Time::new(hour as i8, minute as i8, second as i8, 0).ok()?;
    let instant = date.to_datetime(time).to_zoned(jiff::tz::TimeZone::UTC).ok()?;
    Some((instant.timestamp().as_second() + leap) * 1000 + millisecond)
}

/// Three two-bit codes, X in `shifts[0]`.
fn ranges(octet: u8, shifts: [u8; 3]) -> Result<[Range; 3], PacketRefusal> {
    let mut ranges = [Range::A; 3];
    for (range, shift) in ranges.iter_mut().zip(shifts) {
        *range = Range::from_code((octet >> shift) & 3).ok_or(PacketRefusal::Range)?;
    }
    Ok(ranges)
}

/// The order of ranges in the science record: Z, Y, X from bit 0.
const ACC_RANGE_SHIFTS: [u8; 3] = [4, 2, 0];
/// The order of ranges everywhere else: X, Y, Z from bit 0.
const RANGE_SHIFTS: [u8; 3] = [0, 2, 4];

fn range_octet(ranges: [Range; 3], shifts: [u8; 3]) -> u8 {
    ranges.iter().zip(shifts).fold(0, |octet, (range, shift)| octet | (range.index() as u8) << shift)
}

/// Raw temperature to degrees Celsius [PIMS, class oare].
fn temperature_c(raw: u16) -> f64 {
    (32_768.0 - f64::from(raw)) * 20.0 / 65_536.0 * 20.0 - 17.8
}

fn read_acc(id: PacketId, data: &[u8]) -> Result<AccRecord, PacketRefusal> {
    let octets = exactly::<ACC_OCTETS>(data)?;
    let orbiter_unix_ms = orbiter_unix_ms(octets).ok_or(PacketRefusal::Bcd)?;
    let ranges = ranges(octets[73], ACC_RANGE_SHIFTS)?;
    let mut counts = [[0i16; 3]; SAMPLES_PER_RECORD];
    for (position, count) in counts.as_flattened_mut().iter_mut().enumerate() {
        let raw = i32::from(le_u16(octets, 10 + 2 * position));
        *count = (32_768 - raw).min(i32::from(AccRecord::RAIL_COUNTS)) as i16;
    }
    Ok(AccRecord {
        clock: id.clock,
        sequence: id.sequence,
        orbiter_unix_ms,
        counts,
        temperature_c: temperature_c(le_u16(octets, 70)) as f32,
        mode: Mode::from_code(octets[72] & 7).unwrap_or(Mode::Unknown),
        quiet: octets[72] & 0x08 != 0,
        table_moving: octets[72] & 0x20 != 0,
        at_rail: octets[72] & 0x40 != 0,
        ranges,
        target: octets[74] & 3,
        step: Step::from_code((octets[74] >> 2) & 7).unwrap_or(Step::None),
    })
}

fn read_hsk(id: PacketId, data: &[u8]) -> Result<Housekeeping, PacketRefusal> {
    let octets = exactly::<HSK_OCTETS>(data)?;
    Ok(Housekeeping {
        clock: id.clock,
        sensor_temperature_c: f64::from(be_u16(octets, 0) as i16) * 0.01,
        electronics_temperature_c: f64::from(be_u16(octets, 2) as i16) * 0.01,
        bus_v: f64::from(be_u16(octets, 4)) * 0.001,
        data_status: octets[6],
        ranges: ranges(octets[7], RANGE_SHIFTS)?,
        bias_calibrations: be_u16(octets, 8),
        scale_calibrations: be_u16(octets, 10),
    })
}

fn read_tbl(id: PacketId, data: &[u8]) -> Result<TableReport, PacketRefusal> {
    let octets = exactly::<TBL_OCTETS>(data)?;
    Ok(TableReport {
        clock: id.clock,
        mode: Mode::from_code(octets[0]).ok_or(PacketRefusal::Code)?,
        step: Step::from_code(octets[1]).ok_or(PacketRefusal::Code)?,
        target: octets[2],
        ranges: ranges(octets[3], RANGE_SHIFTS)?,
        calibration_id: be_u16(octets, 4),
        angle_rad: (f64::from(be_u16(octets, 6) as i16) * 0.01).to_radians(),
        rate_rad_s: (f64::from(be_u32(octets, 8) as i32) * 0.001).to_radians(),
    })
}

fn read_evt(id: PacketId, data: &[u8]) -> Result<Event, PacketRefusal> {
    if data.len() < EVT_OCTETS_MIN || data.len() != EVT_OCTETS_MIN + usize::from(data[6]) {
        return Err(PacketRefusal::Length);
    }
    let text = std::str::from_utf8(&data[EVT_OCTETS_MIN..]).map_err(|_| PacketRefusal::Text)?;
    Ok(Event {
        clock: id.clock,
        code: EventCode::from_code(be_u16(data, 0)),
        argument: be_u32(data, 2),
        text: text.to_owned(),
    })
}

fn read_prc(id: PacketId, data: &[u8]) -> Result<OnBoardEstimate, PacketRefusal> {
    let octets = exactly::<PRC_OCTETS>(data)?;
    let axis = |at: usize| {
        Ok(PrcAxis {
            range: Range::from_code(octets[at]).ok_or(PacketRefusal::Range)?,
            mean_sixteenths: be_u32(octets, at + 1) as i32,
            deviation_sixteenths: be_u32(octets, at + 5),
            q_thousandths: be_u16(octets, at + 9),
            trim_ten_thousandths: be_u16(octets, at + 11),
            points_kept: be_u16(octets, at + 13),
        })
    };
    Ok(OnBoardEstimate { clock: id.clock, axes: [axis(0)?, axis(15)?, axis(30)?] })
}

/// The raw value of a count on the wire: offset binary with inverted sign.
pub fn raw_from_counts(counts: i32) -> u16 {
    (32_768 - counts).clamp(0, 65_535) as u16
}

/// The raw value nearest to a temperature.
pub fn raw_from_temperature(temperature_c: f64) -> u16 {
    (32_768.0 - (temperature_c + 17.8) / 400.0 * 65_536.0).round().clamp(0.0, 65_535.0) as u16
}

/// Writes a science record.
pub fn write_acc(record: &AccRecord) -> [u8; ACC_OCTETS] {
    let mut octets = [0u8; ACC_OCTETS];
    let seconds = record.orbiter_unix_ms.div_euclid(1000);
    let instant = jiff::Timestamp::from_second(seconds).expect("a time the calendar holds");
    let civil = instant.to_zoned(jiff::tz::TimeZone::UTC).datetime();
    let fields = [
        i32::from(civil.year()) / 100,
        i32::from(civil.year()) % 100,
        i32::from(civil.month()),
        i32::from(civil.day()),
        i32::from(civil.hour()),
        i32::from(civil.minute()),
        i32::from(civil.second()),
    ];
    for (octet, field) in octets.iter_mut().zip(fields) {
        *octet = (field / 10 * 16 + field % 10) as u8;
    }
    let millisecond = record.orbiter_unix_ms.rem_euclid(1000) as u16;
    octets[8..10].copy_from_slice(&millisecond.to_le_bytes());
    for (position, count) in record.counts.as_flattened().iter().enumerate() {
        let raw = raw_from_counts(i32::from(*count));
        octets[10 + 2 * position..12 + 2 * position].copy_from_slice(&raw.to_le_bytes());
    }
    octets[70..72].copy_from_slice(&raw_from_temperature(f64::from(record.temperature_c)).to_le_bytes());
    octets[72] = data_status(record);
    octets[73] = range_octet(record.ranges, ACC_RANGE_SHIFTS);
    octets[74] = (record.target & 3) | (record.step as u8) << 2;
    octets
}

/// The data status octet of a science record.
pub fn data_status(record: &AccRecord) -> u8 {
    record.mode.code()
        | u8::from(record.quiet) << 3
        | u8::from(record.table_moving) << 5
        | u8::from(record.at_rail) << 6
}

/// Writes housekeeping data.
pub fn write_hsk(report: &Housekeeping) -> [u8; HSK_OCTETS] {
    let centi = |value: f64| (value * 100.0).round() as i16;
    let mut octets = [0u8; HSK_OCTETS];
    octets[0..2].copy_from_slice(&centi(report.sensor_temperature_c).to_be_bytes());
    octets[2..4].copy_from_slice(&centi(report.electronics_temperature_c).to_be_bytes());
    octets[4..6].copy_from_slice(&((report.bus_v * 1000.0).round() as u16).to_be_bytes());
    octets[6] = report.data_status;
    octets[7] = range_octet(report.ranges, RANGE_SHIFTS);
    octets[8..10].copy_from_slice(&report.bias_calibrations.to_be_bytes());
    octets[10..12].copy_from_slice(&report.scale_calibrations.to_be_bytes());
    octets
}

/// Writes table data.
pub fn write_tbl(report: &TableReport) -> [u8; TBL_OCTETS] {
    let mut octets = [0u8; TBL_OCTETS];
    octets[0] = report.mode.code();
    octets[1] = report.step as u8;
    octets[2] = report.target;
    octets[3] = range_octet(report.ranges, RANGE_SHIFTS);
    octets[4..6].copy_from_slice(&report.calibration_id.to_be_bytes());
    octets[6..8].copy_from_slice(&((report.angle_rad.to_degrees() * 100.0).round() as i16).to_be_bytes());
    octets[8..12].copy_from_slice(&((report.rate_rad_s.to_degrees() * 1000.0).round() as i32).to_be_bytes());
    octets
}

/// Writes event data; of a text longer than 255 octets only the first 255 (cut at a character) are kept.
pub fn write_evt(event: &Event) -> Vec<u8> {
    let length = event.text.floor_char_boundary(255);
    let text = &event.text.as_bytes()[..length];
    let mut octets = Vec::with_capacity(EVT_OCTETS_MIN + text.len());
    octets.extend(event.code.code().to_be_bytes());
    octets.extend(event.argument.to_be_bytes());
    octets.push(text.len() as u8);
    octets.extend(text);
    octets
}

/// Writes an on-board estimate.
pub fn write_prc(estimate: &OnBoardEstimate) -> Vec<u8> {
    let mut octets = Vec::with_capacity(PRC_OCTETS);
    for axis in &estimate.axes {
        octets.push(axis.range.index() as u8);
        octets.extend(axis.mean_sixteenths.to_be_bytes());
        octets.extend(axis.deviation_sixteenths.to_be_bytes());
        octets.extend(axis.q_thousandths.to_be_bytes());
        octets.extend(axis.trim_ten_thousandths.to_be_bytes());
        octets.extend(axis.points_kept.to_be_bytes());
    }
    octets
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Clock;

    fn acc() -> AccRecord {
        let mut counts = [[0i16; 3]; SAMPLES_PER_RECORD];
        counts[0] = [-32_767, 5, 32_767];
        counts[9] = [12, -13, 14];
        AccRecord {
            clock: Clock::from_tenths(2_262_800),
            sequence: 3,
            orbiter_unix_ms: 773_897_021_615,
            counts,
            temperature_c: temperature_c(raw_from_temperature(3.84)) as f32,
            mode: Mode::Bias,
            quiet: true,
            table_moving: true,
            at_rail: true,
            ranges: [Range::C, Range::A, Range::B],
            target: 2,
            step: Step::Opposite,
        }
    }

    fn packet(apid: Apid, data: &[u8]) -> SpacePacket<'_> {
        SpacePacket { id: PacketId { apid, clock: Clock::from_tenths(2_262_800), sequence: 3 }, data }
    }

    #[test]
    fn a_written_science_record_is_read_back() {
        let octets = write_acc(&acc());
        assert_eq!(Record::read(&packet(Apid::ACC, &octets)), Ok(Record::Acc(acc())));
    }

    #[test]
    fn a_science_record_that_makes_no_sense_is_refused_by_its_reason() {
        let good = write_acc(&acc());
        assert_eq!(Record::read(&packet(Apid::ACC, &good[..74])), Err(PacketRefusal::Length));
        for (at, value, refusal) in [
            (2, 0x13, PacketRefusal::Bcd),
            (3, 0x32, PacketRefusal::Bcd),
            (4, 0x2A, PacketRefusal::Bcd),
            (73, 0b11_0000, PacketRefusal::Range),
        ] {
            let mut octets = good;
            octets[at] = value;
            assert_eq!(Record::read(&packet(Apid::ACC, &octets)), Err(refusal), "octet {at} = {value:#x}");
        }
    }

    #[test]
    fn a_mode_without_a_meaning_does_not_cost_the_second() {
        let mut octets = write_acc(&acc());
        octets[72] = 0;
        octets[74] = 7 << 2;
        let Ok(Record::Acc(record)) = Record::read(&packet(Apid::ACC, &octets)) else { panic!("refused") };
        assert_eq!((record.mode, record.step), (Mode::Unknown, Step::None));
    }

    #[test]
    fn an_event_with_a_text_of_another_length_is_refused() {
        let event =
            Event { clock: Clock::from_tenths(2_262_800), code: EventCode::Other(99), argument: 7, text: "µg".into() };
        let octets = write_evt(&event);
        assert_eq!(Record::read(&packet(Apid::EVT, &octets)), Ok(Record::Evt(event)));
        assert_eq!(Record::read(&packet(Apid::EVT, &octets[..octets.len() - 1])), Err(PacketRefusal::Length));
    }

    #[test]
    fn an_on_board_estimate_is_read_back() {
        let axis = PrcAxis {
            range: Range::B,
            mean_sixteenths: -20_916,
            deviation_sixteenths: 2109,
            q_thousandths: 1887,
            trim_ten_thousandths: 2420,
            points_kept: 259,
        };
        let estimate = OnBoardEstimate { clock: Clock::from_tenths(2_262_800), axes: [axis; 3] };
        assert_eq!(Record::read(&packet(Apid::PRC, &write_prc(&estimate))), Ok(Record::Prc(estimate)));
    }
}
