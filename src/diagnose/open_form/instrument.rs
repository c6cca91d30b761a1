//! Forms of the sensor: its own signal, and its temperature.

use super::history::LATE_S;
use super::{AXIS, Collector};
use crate::diagnose::measure::relaxing;
use crate::diagnose::scene::Scene;
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
    let slope_over = |g: usize, rows: usize| {
        let [a, b] = [g.saturating_sub(rows), (g + rows).min(last)];
        (t[b] - t[a]) / (s.grid_s[b] - s.grid_s[a])
    };
    // Rounding is a small part of ten minutes' change; what follows a faster one is not seen in that.
    let slope = |g: usize| slope_over(g, 15);
    let slopes = [(15, "dT/dt"), (4, "dT/dt, within minutes"), (1, "dT/dt, from row to row")]
        .map(|(rows, said)| (said.to_string(), s.measure_scalar(|g| slope_over(g, rows))));
    c.family("temperature", "changing temperature", slopes);
    c.grid("|dT/dt|", "temperature", "changing temperature", |g| slope(g).abs());
    c.grid("(T - <T>)^2", "temperature", "extreme temperature", |g| (t[g] - mean).powi(2));
    c.grid("(T - <T>)^3", "temperature", "extreme temperature", |g| (t[g] - mean).powi(3));
    for i in 0..3 {
        c.grid(format!("B{} (T - <T>)", AXIS[i]), "temperature", "a strong field and an extreme temperature", |g| {
            s.field_body_t[g][i] * (t[g] - mean)
        });
    }
    let behind = |series: &[f64], slack: f64| -> Vec<f64> {
        following(series, slack).iter().zip(series).map(|(follower, x)| follower - x).collect()
    };
    let slacks = [0.15, 0.3, 0.5, 0.8, 1.2].map(|slack| {
        let behind = behind(t, slack);
        (format!("T behind itself by a slack of {slack:.2} C"), s.measure_scalar(|g| behind[g]))
    });
    c.family("temperature", "reversals of the temperature", slacks);
    // What is moved by it alone, through a slack, is the follower itself.
    let deviation = crate::math::rms::rms_about_mean(t);
    let followers = [0.4, 0.8, 1.2, 1.7, 2.4].map(|share| {
        let slack = share * deviation;
        let follower = following(t, slack);
        (format!("T through a slack of {slack:.2} C"), s.measure_scalar(|g| follower[g]))
    });
    c.family("temperature", "reversals of the temperature", followers);
    for i in 0..3 {
        let rms = crate::math::rms::rms_about_mean(&m[i]);
        let slacks = [0.5, 1.0, 2.0].map(|share| {
            let slack = share * rms;
            (format!("m{} behind itself by a slack of {slack:.0} ng", AXIS[i]), behind(&m[i], slack))
        });
        c.family("modelled_signal", "reversals of the modelled signal", slacks);
        let mut size: Vec<f64> = m[i].iter().map(|x| x.abs()).collect();
        size.sort_by(f64::total_cmp);
        let beyond = [0.3, 0.5, 0.7, 0.85].map(|share| {
            let level = size[((size.len() - 1) as f64 * share) as usize];
            let beyond = m[i].iter().map(|x| x - x.clamp(-level, level)).collect();
            (format!("m{} beyond {level:.0} ng", AXIS[i]), beyond)
        });
        c.family("modelled_signal", place, beyond);
        let late = LATE_S.map(|tau_s| {
            let late = relaxing(&s.grid_s, &s.simulated_grid_ng[i], tau_s);
            (format!("m{}, relaxing in {tau_s:.0} s", AXIS[i]), s.measure_scalar(|g| late[g]))
        });
        c.family("modelled_signal", "after changes of the modelled signal", late);
        c.grid(format!("m{} (T - <T>)", AXIS[i]), "temperature", place, |g| s.simulated_grid_ng[i][g] * (t[g] - mean));
    }
    c.family("temperature", "between two temperatures", relays(s));
    c.vectors(
        "m (T - <T>)",
        "temperature",
        "a large modelled signal",
        &[&|g| {
            Vec3::new(s.simulated_grid_ng[0][g], s.simulated_grid_ng[1][g], s.simulated_grid_ng[2][g]) * (t[g] - mean)
        }],
    );
}

/// Hysteresis: what follows a series with slack (the play operator of Prandtl 1928), from what that begins with.
fn following(series: &[f64], slack: f64) -> Vec<f64> {
    let mut follower = series[0];
    let follow = |x: &f64| {
        follower = follower.clamp(x - slack / 2.0, x + slack / 2.0);
        follower
    };
    series.iter().map(follow).collect()
}

/// A relay by the temperature, as the thermostat of a heater: on below one level and off above another, each at one of these shares of
/// the record. One level alone is a threshold.
fn relays(s: &Scene) -> Vec<(String, Vec<f64>)> {
    const LEVELS: usize = 11;
    const WIDEST: usize = 4;
    let t = &s.temperature_c;
    let mut sorted = t.clone();
    sorted.sort_by(f64::total_cmp);
    let level = |i: usize| sorted[(sorted.len() - 1) * (2 * i + 1) / (2 * LEVELS)];
    let mut members = Vec::new();
    for low in 0..LEVELS {
        for high in low + 1..=(low + WIDEST).min(LEVELS - 1) {
            let (on_c, off_c) = (level(low), level(high));
            let on = relay(t, on_c, off_c);
            let said = format!("on below T = {on_c:.2} C until T = {off_c:.2} C");
            members.push((said, s.measure_scalar(|g| on[g])));
        }
    }
    members
}

/// 1 from where a series falls below one level until it rises above the other, else 0.
fn relay(series: &[f64], on_below: f64, off_above: f64) -> Vec<f64> {
    let first = series.iter().find(|x| **x < on_below || **x > off_above);
    let mut on = first.is_some_and(|x| *x < on_below);
    let follow = |x: &f64| {
        on = *x < on_below || on && *x <= off_above;
        f64::from(u8::from(on))
    };
    series.iter().map(follow).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_relay_holds_between_its_levels() {
        let t = [5.0, 3.9, 4.5, 5.5, 4.5, 6.1, 4.5, 3.5, 4.5];
        assert_eq!(relay(&t, 4.0, 6.0), [1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0]);
        assert_eq!(relay(&[6.5, 5.0, 3.0, 5.0], 4.0, 6.0), [0.0, 0.0, 1.0, 1.0]);
    }
}
