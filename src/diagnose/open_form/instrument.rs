//! Forms of the sensor: its own signal, and its temperature.

use super::{AXIS, Collector};
use crate::physics::Vec3;

pub(super) fn sensor(c: &mut Collector) {
    let s = c.scene;
    let m = s.simulated_ng.clone();
    let place = "a large modelled signal";
    for i in 0..3 {
        c.windows(format!("m{}", AXIS[i]), "modelled_signal", place, m[i].clone());
        c.windows(format!("|m{}|", AXIS[i]), "modelled_signal", place, m[i].iter().map(|x| x.abs()).collect());
        c.windows(format!("m{}^3", AXIS[i]), "modelled_signal", place, m[i].iter().map(|x| x.powi(3)).collect());
        let last = s.grid_s.len() - 1;
        c.grid(format!("dm{}/dt", AXIS[i]), "modelled_signal", "a changing modelled signal", |g| {
            let [a, b] = [g.saturating_sub(1), (g + 1).min(last)];
            (s.simulated_grid_ng[i][b] - s.simulated_grid_ng[i][a]) / (s.grid_s[b] - s.grid_s[a])
        });
        for j in i..3 {
            c.windows(
                format!("m{} m{}", AXIS[i], AXIS[j]),
                "modelled_signal",
                place,
                m[i].iter().zip(&m[j]).map(|(a, b)| a * b).collect(),
            );
        }
        c.windows(
            format!("average deviation {}", AXIS[i]),
            "activity",
            "noisy windows",
            s.case.recording.dev_ng[i].clone(),
        );
    }
    let t = &s.temperature_c;
    let mean = t.iter().sum::<f64>() / t.len() as f64;
    let last = t.len() - 1;
    let slope = |g: usize| {
        let [a, b] = [g.saturating_sub(15), (g + 15).min(last)];
        (t[b] - t[a]) / (s.grid_s[b] - s.grid_s[a])
    };
    c.grid("dT/dt", "temperature", "changing temperature", slope);
    c.grid("|dT/dt|", "temperature", "changing temperature", |g| slope(g).abs());
    c.grid("(T - <T>)^2", "temperature", "extreme temperature", |g| (t[g] - mean).powi(2));
    c.grid("(T - <T>)^3", "temperature", "extreme temperature", |g| (t[g] - mean).powi(3));
    c.vectors(
        "m (T - <T>)",
        "temperature",
        "a large modelled signal",
        &[&|g| {
            Vec3::new(s.simulated_grid_ng[0][g], s.simulated_grid_ng[1][g], s.simulated_grid_ng[2][g]) * (t[g] - mean)
        }],
    );
}
