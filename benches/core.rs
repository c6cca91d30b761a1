//! The pure core: sync search and FECF in octets per second, adaptive trimmed-mean windows per second.
//!
//! Each figure stands beside a yardstick measured in the same run: a plain CRC-16 pass over the same octets; SciPy's
//! vectorised `trim_mean` on f64 where Python with SciPy is at hand (`benches/peers/trim_mean.py`).

use std::hint::black_box;
use std::process::Command;

use crc::{CRC_16_IBM_3740, Crc, Table};
use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use oare_ground::ingest::wire::coding::SYNC_MARKER;
use oare_ground::ingest::wire::{Deframer, FrameId, LinkConfig, frame};
use oare_ground::pipeline::settings::WindowPolicy;
use oare_ground::pipeline::window::{HalfWindow, Window};
use oare_ground::telemetry::{AccRecord, Mode, Range, Step};
use oare_ground::units::Clock;
use rand::{Rng, RngExt, SeedableRng};

/// Frames in a stream: 4.6 MB.
const FRAMES: u32 = 4096;
/// Half windows in a batch: 25 s each.
const HALVES: usize = 1001;

fn stream() -> Vec<u8> {
    let link = LinkConfig::default();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut data = vec![0u8; 1103];
    let mut stream = Vec::new();
    for count in 0..FRAMES {
        rng.fill_bytes(&mut data);
        stream.extend(SYNC_MARKER.to_be_bytes());
        stream.extend(frame::write(&link, FrameId { channel: 1, count }, count as u8, 0, &data));
    }
    stream
}

/// The same bits, time-reversed, behind three bits.
fn reversed_and_shifted(stream: &[u8]) -> Vec<u8> {
    let reversed: Vec<u8> = stream.iter().rev().map(|octet| octet.reverse_bits()).collect();
    let mut shifted = vec![0b1010_0000 | reversed[0] >> 3];
    shifted.extend(reversed.windows(2).map(|pair| pair[0] << 5 | pair[1] >> 3));
    shifted.push(reversed[reversed.len() - 1] << 5);
    shifted
}

fn deframe(stream: &[u8]) -> usize {
    let mut deframer = Deframer::new(LinkConfig::default());
    let mut frames = 0;
    stream.chunks(65_536).for_each(|chunk| deframer.push(chunk, |_| frames += 1));
    deframer.finish(|_| frames += 1);
    frames
}

/// What this runs on.
fn machine() -> String {
    let cpus = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpus.lines().find_map(|line| line.strip_prefix("model name")?.split(':').nth(1));
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    format!("{}, {cores} cores", model.map_or("an unnamed processor", str::trim))
}

fn sync(c: &mut Criterion) {
    println!("machine: {}", machine());
    let aligned = stream();
    let reversed = reversed_and_shifted(&aligned);
    let noise: Vec<u8> = {
        let mut octets = vec![0u8; aligned.len()];
        rand_chacha::ChaCha8Rng::seed_from_u64(2).fill_bytes(&mut octets);
        octets
    };
    assert_eq!((deframe(&aligned), deframe(&reversed)), (FRAMES as usize, FRAMES as usize));
    let crc = Crc::<u16, Table<16>>::new(&CRC_16_IBM_3740);
    let mut group = c.benchmark_group("sync and FECF");
    group.throughput(Throughput::Bytes(aligned.len() as u64));
    group.bench_function("aligned, forward", |b| b.iter(|| deframe(black_box(&aligned))));
    group.bench_function("3 bits off, reversed", |b| b.iter(|| deframe(black_box(&reversed))));
    group.bench_function("noise only: the search in all senses", |b| b.iter(|| deframe(black_box(&noise))));
    group.bench_function("yardstick: plain CRC-16 of the same octets", |b| {
        b.iter(|| aligned.chunks(1119).map(|cadu| crc.checksum(black_box(&cadu[4..]))).fold(0, |sum, x| sum ^ x));
    });
    group.finish();
}

/// Records of 25 s with noise of the mission's size.
fn cells() -> Vec<Vec<AccRecord>> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut normal = |sd: f64| {
        let (u, v): (f64, f64) = (rng.random(), rng.random());
        (sd * (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()) as i16
    };
    (0..HALVES)
        .map(|cell| {
            (0..25)
                .map(|second| AccRecord {
                    clock: Clock::from_tenths(cell as i64 * 250 + second * 10),
                    sequence: 0,
                    orbiter_unix_ms: 0,
                    counts: std::array::from_fn(|_| [normal(340.0) - 2000, normal(110.0), normal(90.0) + 1500]),
                    temperature_c: 4.0,
                    mode: Mode::Normal,
                    quiet: false,
                    table_moving: false,
                    at_rail: false,
                    ranges: [Range::C; 3],
                    target: 0,
                    step: Step::None,
                })
                .collect()
        })
        .collect()
}

fn trimmed_means(c: &mut Criterion) {
    let cells = cells();
    let policy = WindowPolicy::default();
    let mut group = c.benchmark_group("adaptive trimmed mean");
    group.throughput(Throughput::Elements(HALVES as u64 - 1));
    group.bench_function("three-axis windows of 500, every 250: records to estimates", |b| {
        b.iter_batched(
            || (),
            |()| {
                let mut last = HalfWindow::of(&cells[0]);
                let mut sum = 0.0;
                for (number, cell) in cells[1..].iter().enumerate() {
                    let half = HalfWindow::of(black_box(cell));
                    let window = Window::of(number as i64, [&last, &half], &policy);
                    sum += window.and_then(|w| w.axes[0]).map_or(0.0, |axis| axis.estimate.mean);
                    last = half;
                }
                sum
            },
            BatchSize::SmallInput,
        );
    });
    group.finish();
    scipy();
}

/// Runs the peer in the same run, where it is at hand.
fn scipy() {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peers/trim_mean.py");
    match Command::new("python3").arg(script).output() {
        Ok(output) if output.status.success() => print!("{}", String::from_utf8_lossy(&output.stdout)),
        Ok(output) => println!(
            "SKIPPED: SciPy yardstick: {}",
            String::from_utf8_lossy(&output.stderr).lines().last().unwrap_or("")
        ),
        Err(error) => println!("SKIPPED: SciPy yardstick: {error}"),
    }
}

criterion_group!(benches, sync, trimmed_means);
criterion_main!(benches);
