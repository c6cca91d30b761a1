"""SciPy's vectorised trim_mean over three-axis windows of 500 samples every 250: the yardstick of `cargo bench --bench core`.

Needs numpy and scipy. It trims a fixed 5 % per end: the adaptive law, Q and the deviations are not part of its work.
"""

import time

import numpy as np
from scipy.stats import trim_mean

WINDOWS = 1000
rng = np.random.default_rng(3)
samples = np.round(rng.normal(size=(3, (WINDOWS + 1) * 250)) * np.array([[340.0], [110.0], [90.0]]))
windows = np.lib.stride_tricks.sliding_window_view(samples, 500, axis=1)[:, ::250, :]
best = float("inf")
for _ in range(20):
    start = time.perf_counter()
    trim_mean(windows, 0.05, axis=2)
    best = min(best, time.perf_counter() - start)
print(f"yardstick: SciPy trim_mean, best of 20: {WINDOWS / best:,.0f} three-axis windows/s")
