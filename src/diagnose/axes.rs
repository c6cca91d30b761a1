//! Series on the three body axes, and sums of them.

/// One series per body axis.
pub type Axes = [Vec<f64>; 3];

/// A regressor before whitening: a series for every axis it acts on, at the windows; of a bias of the sensor, what flips of the table see of it
/// is behind those.
pub type Raw = [Option<Vec<f64>>; 3];

/// Nothing on every axis, in so many windows.
pub fn nothing(windows: usize) -> Axes {
    std::array::from_fn(|_| vec![0.0; windows])
}

/// Adds a part so many times.
pub fn add(total: &mut Axes, part: &Axes, times: f64) {
    for (total, series) in total.iter_mut().zip(part) {
        total.iter_mut().zip(series).for_each(|(t, x)| *t += times * x);
    }
}

/// The same, and what flips see of it behind the windows.
pub fn add_regressor_and_flips(total: &mut Axes, regressor: &Raw, times: f64) {
    for (total, series) in total.iter_mut().zip(regressor) {
        let Some(series) = series else { continue };
        total.resize(total.len().max(series.len()), 0.0);
        total.iter_mut().zip(series).for_each(|(t, x)| *t += times * x);
    }
}

/// Adds a regressor so many times, on the axes it acts on and at the windows.
pub fn add_regressor(total: &mut Axes, regressor: &Raw, times: f64) {
    for (total, series) in total.iter_mut().zip(regressor) {
        let Some(series) = series else { continue };
        total.iter_mut().zip(series).for_each(|(t, x)| *t += times * x);
    }
}
