"""Peers of `oare challenge`: four usual methods on the same case directories, the same metrics printed.

    python peers.py CASES_DIR [TRUTH_DIR] [--limit N] [--times]

CASES_DIR holds case directories (as `oare challenge --out DIR` writes them, DIR/cases, their truths in DIR/truth; or the open
cases, which carry their truth.json). All methods get regressors of the right form and the same autoregressive whitening
(except the last two, which work on raw residuals as they are usually run). Losses are printed like wins.
"""
import argparse, csv, json, sys, time, tomllib, warnings
from pathlib import Path

import numpy as np
from scipy.linalg import toeplitz, solve
from scipy.signal import lfilter
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import lasso_path

warnings.filterwarnings("ignore", category=ConvergenceWarning)  # the path's far end is not chosen by BIC

NG, MU, EARTH = 9.80665e-9, 3.986004418e14, 7.2921159e-5
AR_ORDER, GATE = 12, 25.0  # chi-square gain per group, less 2 ln n a column, that a name must have


def table(path):
    return np.genfromtxt(path, delimiter=",", skip_header=1, invalid_raise=False)


def window(t_rec, t, y):
    """Mean over the 50 s about each instant."""
    at = np.linspace(-25, 25, 11)
    w = np.r_[0.5, np.ones(9), 0.5] / 10
    return sum(wi * np.interp(t_rec + d, t, y) for wi, d in zip(w, at))


def measured(t_rec, t, v):
    return np.column_stack([window(t_rec, t, v[:, k]) for k in range(v.shape[1])])


def sun(epoch_days, t):
    n = epoch_days + t / 86400
    g = np.radians(357.528 + 0.9856003 * n)
    lam = np.radians(280.46 + 0.9856474 * n + 1.915 * np.sin(g))
    eps = np.radians(23.439)
    return np.column_stack([np.cos(lam), np.cos(eps) * np.sin(lam), np.sin(eps) * np.sin(lam)])


def dipole(r, t, epoch_days):
    """Tilted dipole of 1995: the peers' stand-in for the geomagnetic field, inertial, in tesla."""
    gmst = np.radians(280.46062 + 360.98564737 * (epoch_days + t / 86400))
    m = np.array([-1784.0, 5306.0, -29692.0]) * 1e-9
    mi = np.column_stack([m[0] * np.cos(gmst) - m[1] * np.sin(gmst), m[0] * np.sin(gmst) + m[1] * np.cos(gmst), 0 * t + m[2]])
    radius = np.linalg.norm(r, axis=1)[:, None]
    e = r / radius
    return (3 * e * np.sum(mi * e, 1)[:, None] - mi) * (6371200 / radius) ** 3


class Case:
    """A case with the regressors of the catalogue, grouped; nonlinear members on a coarse grid."""

    def __init__(self, home):
        c = tomllib.loads((home / "case.toml").read_text())
        self.rec, sim, anc = table(home / "recording.csv"), table(home / "simulation.csv"), table(home / "ancillary.csv")
        t = self.t = self.rec[:, 0]
        g, r, v, q, w, rho, temp = anc[:, 0], anc[:, 1:4], anc[:, 4:7], anc[:, 7:11], anc[:, 11:14], anc[:, 14], anc[:, 15]
        qw, qx, qy, qz = q.T
        C = np.array([[1 - 2 * (qy**2 + qz**2), 2 * (qx * qy - qw * qz), 2 * (qx * qz + qw * qy)],
                      [2 * (qx * qy + qw * qz), 1 - 2 * (qx**2 + qz**2), 2 * (qy * qz - qw * qx)],
                      [2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx), 1 - 2 * (qx**2 + qy**2)]]).transpose(2, 0, 1)
        body = lambda x: np.einsum("nij,nj->ni", C, x)
        days = np.datetime64(c["case"]["epoch_utc"].rstrip("Z")) - np.datetime64("2000-01-01T12:00:00")
        days = days / np.timedelta64(1, "D")
        veh, b = c["vehicle"], np.array(c["vehicle"]["sensor_offset_m"])
        area, s = np.array(veh["area_m2"]), sun(days, g)
        R = np.linalg.norm(r, axis=1)
        e, wd = body(r / R[:, None]), np.gradient(w, g, axis=0)
        gg = lambda d: -(MU / R**3)[:, None] * (3 * e * (e @ d)[:, None] - d) / NG
        rot = lambda d: (np.cross(w, np.cross(w, d)) + np.cross(wd, d)) / NG

        def drag(spin):
            u = body(v - spin * np.cross([0, 0, EARTH], r))
            speed = np.linalg.norm(u, axis=1)[:, None]
            size = 0.5 * rho[:, None] * veh["drag_coefficient"] * (np.abs(u / speed) @ area)[:, None] / veh["mass_kg"]
            return -size * speed * u / NG

        lit = ((np.sum(r * s, 1) > 0) | (np.linalg.norm(r - np.sum(r * s, 1)[:, None] * s, axis=1) > 6378137.0)).astype(float)
        lag = np.pi / 6
        apex = np.column_stack([s[:, 0] * np.cos(lag) - s[:, 1] * np.sin(lag), s[:, 0] * np.sin(lag) + s[:, 1] * np.cos(lag), s[:, 2]])
        sb, ad = body(s), drag(1.0)
        srp = -lit[:, None] * 4.56e-6 * (np.abs(sb) @ area)[:, None] / veh["mass_kg"] * sb / NG
        M = lambda x: measured(t, g, x)
        sim_t = measured(t, sim[:, 0], sim[:, 1:4])
        self.y = self.rec[:, 1:4] - sim_t
        events = list(csv.DictReader(open(home / "events.csv")))
        spans = lambda kind: [(float(x["clock_s"]), float(x["clock_s"]) + float(x["duration_s"])) for x in events if x["kind"] == kind]
        on = lambda kind: np.clip(sum((np.clip(np.minimum(t + 25, b1) - np.maximum(t - 25, a1), 0, 50) / 50 for a1, b1 in spans(kind)), 0 * t), 0, 1)
        cols = lambda *xs: [M(x) for x in xs]
        each = lambda x: [np.eye(3)[k] * x[:, None] for k in range(3)]
        I = np.eye(3)
        T = [M(gg(I[k]) + rot(I[k])) for k in range(3)]
        G = {"gravity_gradient": cols(gg(b)), "rotation": cols(rot(b)), "cg_offset": T, "aerodynamic_drag": cols(ad),
             "diurnal_bulge": cols(ad * np.sum(apex * r, 1)[:, None] / R[:, None]),
             "atmosphere_corotation": cols(drag(1.0) - drag(0.0)), "solar_radiation_pressure": cols(srp),
             "misalignment": [np.cross(sim_t, I[k]) for k in range(3)],
             "time_offset": [-np.gradient(sim_t, t, axis=0)]}
        G |= {f"scale_factor:{a}": [sim_t * I[k]] for k, a in enumerate("xyz")}
        B = M(body(dipole(r, g, days))) * 1e6
        G["magnetic_sensitivity"] = [np.eye(3)[i] * B[:, j : j + 1] for i in range(3) for j in range(3)]
        for kind, name in (("water_dump", "water_dump"), ("evaporator", "evaporator_venting"), ("thruster", "thruster_residual"), ("crew_sleep", "crew_activity")):
            if spans(kind):
                G[name] = each(on(kind))
        for t0, _ in spans("mass_change"):
            G["mass_shift"] = [x * (t > t0)[:, None] for x in T]
        for L in (0, 1200, 3600, 7200):
            G[f"temperature_bias:{L}"] = each(np.interp(t - L, g, temp) - temp.mean())
        for onset in t[0] + (t[-1] - t[0]) * np.arange(1, 24) / 24:
            G[f"bias_step:{onset:.0f}"] = each((t > onset) * 1.0)
            for tau in (5e3, 15e3, 40e3):
                G[f"vent_leak:{onset:.0f}:{tau:.0f}"] = each(np.where(t > onset, np.exp(-np.clip(t - onset, 0, None) / tau), 0))
        for tau in (3e4, 8e4):
            G[f"bias_drift:{tau:.0f}"] = each(np.exp(-(t - t[0]) / tau))
        self.groups = G

    def level(self):
        """Noise level of each window relative to its record, from the average deviation."""
        d = self.rec[:, 4:7]
        kernel = np.ones(121) / 121
        smooth = np.column_stack([np.convolve(np.pad(d[:, k], 60, mode="edge"), kernel, "valid") for k in range(3)])
        return smooth / smooth.mean(0)

    def whiten(self, filters, level, x):
        """AR prediction error per axis after division by the level, restarted at gaps; constants projected out."""
        out = []
        for k in range(3):
            z, one = x[:, k] / level[:, k], 1 / level[:, k]
            z, one = (np.concatenate([lfilter(filters[k], 1, part[a:b])[AR_ORDER:] for a, b in self.runs()]) for part in (z, one))
            out.append(z - one * (one @ z) / (one @ one))
        return np.concatenate(out)

    def runs(self):
        edge = np.r_[0, np.where(np.diff(self.t) > 26)[0] + 1, len(self.t)]
        return [(a, b) for a, b in zip(edge[:-1], edge[1:]) if b - a > AR_ORDER + 5]

    def filters(self, residual, level):
        """Yule-Walker per axis on the residual, scaled to unit variance."""
        fs = []
        for k in range(3):
            z = residual[:, k] / level[:, k]
            parts = [z[a:b] - z.mean() for a, b in self.runs()]
            acf = np.array([sum(p[: len(p) - l] @ p[l:] for p in parts) for l in range(AR_ORDER + 1)]) / sum(map(len, parts))
            phi = solve(toeplitz(acf[:-1]) + 1e-3 * acf[0] * np.eye(AR_ORDER), acf[1:])
            fs.append(np.r_[1, -phi] / np.sqrt(max(acf[0] - phi @ acf[1:], 1e-6)))
        return fs


base = lambda name: name.split(":")[0]


def whitened_all(case, model=None):
    level = case.level()
    f = case.filters(case.y if model is None else case.y - model, level)
    y = case.whiten(f, level, case.y)
    return y, {n: np.column_stack([case.whiten(f, level, x) for x in xs]) for n, xs in case.groups.items()}


def project(X, y):
    beta, *_ = np.linalg.lstsq(X, y, rcond=1e-8)
    return y @ y - np.sum((y - X @ beta) ** 2)


def group_search(case):
    """Add, then drop, by chi-square gain less a BIC price and a gate; the noise refitted once on the model found."""
    chosen, model = [], None
    for _ in range(2):
        y, X = whitened_all(case, model)
        price = lambda names: sum((X[n].shape[1] + n.count(":")) for n in names) * np.log(len(y))
        gain = lambda names: project(np.column_stack([X[n] for n in names]), y) - price(names) if names else 0.0
        chosen = []
        while len(chosen) < 3:
            now = gain(chosen)
            free = [n for n in X if base(n) not in map(base, chosen)]
            best = max(free, key=lambda n: gain(chosen + [n]))
            if gain(chosen + [best]) - now < GATE:
                break
            chosen.append(best)
            for n in list(chosen):
                if len(chosen) > 1 and gain(chosen) - gain([m for m in chosen if m != n]) < GATE:
                    chosen.remove(n)
        if not chosen:
            break
        raw = np.stack([x for n in chosen for x in case.groups[n]], -1)
        beta, *_ = np.linalg.lstsq(np.column_stack([X[n] for n in chosen]), y, rcond=1e-8)
        model = raw @ beta
    return [base(n) for n in chosen]


def lasso_bic(case):
    y, X = whitened_all(case)
    names = [n for n in X for _ in range(X[n].shape[1])]
    A = np.column_stack(list(X.values()))
    scale = np.linalg.norm(A, axis=0) + 1e-12
    _, path, _ = lasso_path(A / scale, y, alphas=40, eps=1e-2)
    best = min(range(path.shape[1]), key=lambda k: np.sum((y - (A / scale) @ path[:, k]) ** 2) + np.log(len(y)) * np.count_nonzero(path[:, k]))
    size = {}
    for n, b in zip(names, path[:, best]):
        size[base(n)] = size.get(base(n), 0) + b * b
    return [n for n, s in sorted(size.items(), key=lambda kv: -kv[1]) if s > 1e-9]


def stlsq(case):
    """Sequentially thresholded least squares on raw residuals, columns of unit rms, threshold a tenth of the residual's rms."""
    y = np.concatenate((case.y - case.y.mean(0)).T)
    names, A = [], []
    for n, xs in case.groups.items():
        for x in xs:
            names.append(n)
            A.append(np.concatenate((x - x.mean(0)).T))
    A = np.column_stack(A)
    A /= np.sqrt(np.mean(A**2, 0)) + 1e-12
    keep, gate = np.ones(A.shape[1], bool), 0.1 * np.std(y)
    for _ in range(8):
        beta = np.zeros(A.shape[1])
        gram = A[:, keep].T @ A[:, keep]
        beta[keep] = np.linalg.solve(gram + 1e-3 * len(y) * np.eye(keep.sum()), A[:, keep].T @ y)
        keep = np.abs(beta) > gate
        if not keep.any():
            return []
    size = {}
    for n, b in zip(names, beta):
        size[base(n)] = max(size.get(base(n), 0), abs(b))
    return [n for n, s in sorted(size.items(), key=lambda kv: -kv[1]) if s > gate]


def bias_and_position(case):
    """The Keldysh fit: a constant per axis and the sensor's position, no other name known; F test at 1 %."""
    y = (case.y - case.y.mean(0)) / case.y.std(0)
    y = np.concatenate(y.T)
    X = np.column_stack([np.concatenate(((x - x.mean(0)) / case.y.std(0)).T) for x in case.groups["cg_offset"]])
    gain = project(X, y) / 3 / ((y @ y) / len(y))
    return ["cg_offset"] if gain > 3.78 * 2 else []  # doubled: neighbouring windows overlap by half


METHODS = {"whitened LASSO-BIC": lasso_bic, "whitened group search": group_search, "sparse regression (STLSQ)": stlsq, "bias and position": bias_and_position}


def truth_of(home, truths):
    path = truths / f"{home.name}.json" if truths else home / "truth.json"
    t = json.loads(path.read_text())
    return t.get("truth", t)


def wilson(k, n, z=1.959964):
    p, d = k / n, 1 + z * z / n
    half = z / d * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return max(0, (p + z * z / (2 * n)) / d - half), min(1, (p + z * z / (2 * n)) / d + half)


def main():
    a = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    a.add_argument("cases", type=Path)
    a.add_argument("truths", type=Path, nargs="?")
    a.add_argument("--limit", type=int, default=10**9)
    a.add_argument("--times", action="store_true", help="how long each takes over a case, and nothing else")
    a = a.parse_args()
    done = {m: [] for m in METHODS}
    took = {m: [] for m in METHODS}
    homes = [h for h in sorted(a.cases.iterdir()) if (h / "recording.csv").exists()][: a.limit]
    for k, home in enumerate(homes):
        start = time.perf_counter()
        truth, case = truth_of(home, a.truths), Case(home)
        reading = time.perf_counter() - start
        for m, f in METHODS.items():
            start = time.perf_counter()
            done[m].append((truth, f(case)))
            took[m].append(reading + time.perf_counter() - start)
        print(f"\r{k + 1}/{len(homes)}", end="", file=sys.stderr)
    print(file=sys.stderr)
    if a.times:
        for m, s in took.items():
            print(f"{m}: {np.median(s):.2f} s, {max(s):.2f} s at most")
        return
    snr = lambda t: min(t.get("snr", {"": 0}).values(), default=0)
    kind = lambda *ks: lambda t: t["kind"] in ks
    one = lambda lo, hi: lambda t: t["kind"] == "one" and lo <= snr(t) < hi
    rows = [("false alarm, clean", kind("clean"), lambda t, n: bool(n)), ("false alarm, slow noise", kind("slow"), lambda t, n: bool(n))]
    rows += [(f"right first name, SNR {w}", one(lo, hi), lambda t, n: bool(n) and n[0] in t["effects"]) for w, lo, hi in (("12 and more", 12, 1e9), ("8 to 12", 8, 12), ("5 to 8", 5, 8))]
    same = lambda t, n: set(n) == set(t["effects"])
    rows += [("exactly right, one effect, SNR 12 and more", one(12, 1e9), same), ("exactly right, two effects, SNR 12 and more", lambda t: t["kind"] == "two" and snr(t) >= 12, same)]
    rows += [("unlisted law given a physical name", kind("unknown"), lambda t, n: bool(n)), ("one attitude: truth named", kind("single"), lambda t, n: bool(set(n) & set(t["effects"])))]
    for m, results in done.items():
        print(f"\n{m}")
        for name, which, hit in rows:
            hits = [hit(t, n) for t, n in results if which(t)]
            if hits:
                lo, hi = wilson(sum(hits), len(hits))
                print(f"  {name:<46} {sum(hits):>4}/{len(hits):<4} {100 * np.mean(hits):5.1f} %  ({100 * lo:.1f} to {100 * hi:.1f} %)")


if __name__ == "__main__":
    main()
