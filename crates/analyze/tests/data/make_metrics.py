#!/usr/bin/env python3
"""Makes metrics.json: every metric that docs/metrics.md defines by a formula, from that page with NumPy and SciPy, for
tests/metrics.rs. Run: python3 make_metrics.py > metrics.json

The columns are made of integers by a linear congruential generator and of sines, so that the test makes the same ones but for
rounding; only the answers are stored.
"""

import json
import sys

import numpy as np
import scipy
from noise import noise
from scipy import integrate, interpolate, optimize, signal


TAU = 2 * np.pi
n, step_s, start_s = 1801, 1 / 30, 15.0
t = np.arange(n) / 30
height = 1.2 + (0.04 + 0.0004 * t) * np.sin(TAU * 2.15 * t) + 0.004 * np.sin(TAU * 4.3 * t + 1) + 0.002 * noise(n, 1)
roll = 0.01 + 0.3 * (1 - np.exp(-t / 20)) * np.sin(TAU * 1.075 * t + 0.4) + 0.02 * np.sin(TAU * 2.1 * t) + 0.002 * noise(n, 2)
pitch = 0.01 + 0.004 * np.sin(TAU * 2.15 * t) + 0.001 * noise(n, 3)
yaw = -0.02 + 0.003 * np.sin(TAU * 0.9 * t) + 0.001 * noise(n, 4)
forces = [np.maximum(0, 200 + (240 + 20 * i) * np.sin(TAU * 2.15 * t + 0.5 * i) + 40 * noise(n, 5 + i)) for i in range(3)]
phases = [TAU * (2.15 + 0.002 * i) * t + 0.6 * i + 0.5 * np.sin(0.3 * t + i) + 0.1 * noise(n, 8 + i) for i in range(3)]
beat = np.where(t < 25, np.nan, TAU * 2.15 * t)
steps = [np.cumsum(0.46 + 0.02 * noise(130, 11)), np.cumsum(0.47 + 0.03 * noise(130, 12) + np.where(np.arange(130) == 60, 2.0, 0.0))]
mass_kg, gravity = 60.0, 9.81

w = t >= start_s
out = {}


def rms_deg(x):
    return np.degrees(np.sqrt(np.mean(x**2)))


out["rms_roll_deg"] = rms_deg(roll[w])
out["rms_pitch_deg"] = rms_deg(pitch[w])
out["rms_yaw_deg"] = rms_deg(yaw[w])
out["roll_excess_s"] = np.sum(np.abs(roll[w]) > np.radians(15)) * step_s

f = np.array(forces)[:, w]
total = f.sum(axis=0)
out["contact_loss"] = np.mean((f <= 0).any(axis=0))
out["contact_loss_mean"] = {"value": np.mean(f <= 0), "per": np.mean(f <= 0, axis=1)}
out["t_float"] = np.mean(total <= 0.05 * mass_kg * gravity)
out["force_mean_n"] = {"value": np.mean(f), "per": f.mean(axis=1)}
out["force_sd_n"] = {"value": np.mean(f.std(axis=1)), "per": f.std(axis=1)}
correlations = np.corrcoef(f)[np.triu_indices(3, 1)]
out["force_correlation"] = {"value": np.mean(correlations), "per": correlations}

p = np.array(phases)[:, w]
out["synchrony"] = np.mean(np.abs(np.mean(np.exp(1j * p), axis=0)))
pairs = [np.abs(np.mean(np.exp(1j * (p[i] - p[j])))) for i, j in [(0, 1), (0, 2), (1, 2)]]
out["plv"] = {"value": np.mean(pairs), "per": pairs}


# Of three independent uniform phases: two sum to an arrow of length `two`, the third turns about its end.
quarter = np.linspace(0, np.pi / 2, 20001)
two = 2 * np.cos(quarter[:-1])


def chance_below(x):
    """P(r <= x)."""
    cosine = ((3 * x) ** 2 - two**2 - 1) / (2 * two)
    below = 1 - np.arccos(np.clip(cosine, -1, 1)) / np.pi
    return integrate.simpson([*below, float(x >= 1 / 3)], x=quarter) / (np.pi / 2)


def mean_of_three():
    turns = (np.arange(4000) + 0.5) * TAU / 4000
    middles = (np.arange(1000) + 0.5) * np.pi / 2000
    return np.mean([np.mean(np.abs(2 * np.cos(h) + np.exp(1j * turns))) for h in middles]) / 3


band = [optimize.brentq(lambda x: chance_below(x) - share, 0, 1) for share in (0.025, 0.975)]
out["synchrony_chance"] = {"value": mean_of_three(), "per": band}

sounds = w & np.isfinite(beat)
to_beat = np.mean(np.exp(1j * (np.array(phases)[:, sounds] - beat[sounds])), axis=1)
out["beat_synchrony"] = {"value": np.mean(np.abs(to_beat)), "per": np.abs(to_beat)}
leads = np.angle(to_beat)
out["beat_lead_deg"] = {"value": np.degrees(np.angle(np.mean(np.exp(1j * leads)))), "per": np.degrees(leads)}
out["beat_hz"] = 2.15

z = height[w]
out["dz_pp_m"] = np.ptp(z)
out["rms_z_m"] = np.std(z)
out["z_mean_m"] = np.mean(z)
third = len(z) // 3
about = z - z.mean()
out["growth_ratio"] = np.sqrt(np.mean(about[-third:] ** 2) / np.mean(about[:third] ** 2))
magnitude, hz = np.abs(np.fft.rfft(about)), np.fft.rfftfreq(len(z), step_s)
peak = np.argmax(magnitude)
out["peak_hz"] = hz[peak]
out["h2_ratio"] = magnitude[np.abs(hz - 2 * hz[peak]) <= 0.45].max() / magnitude[peak]
off = roll[w] - roll[w].mean()
out["roll_peak_hz"] = hz[np.argmax(np.abs(np.fft.rfft(off)))]
power = np.abs(np.fft.rfft(off * signal.get_window("hann", len(off)))) ** 2


def near(f0):
    return power[1:][np.abs(hz[1:] - f0) <= 0.1 * hz[peak]].sum()


out["subharmonic_ratio"] = near(hz[peak] / 2) / near(hz[peak])

squares, m = roll[w] ** 2, 60
stretch = np.convolve(squares, np.ones(m), "valid")
out["onset_time_s"] = t[w][np.argmax(stretch > m * np.radians(10) ** 2) + m - 1]

analytic = np.unwrap(np.angle(signal.hilbert(off)))
inner = (t[w] >= 25) & (t[w] <= t[-1] - 2)


def firm(p, q):
    return np.abs(np.mean(np.exp(1j * (p * analytic[inner] - q * beat[w][inner]))))


out["roll_lock"] = {f"{q}:{p}": firm(p, q) for p, q in [(1, 1), (2, 1), (3, 2), (1, 2), (2, 3)]}

rates, variances = [], []
for taken in steps:
    gaps = np.diff(taken[(taken >= start_s) & (taken <= np.inf)])
    walked = gaps[gaps < 1.7 * np.median(gaps)]
    rates.append(1 / walked.mean())
    variances.append((1.96 * rates[-1] ** 2 * walked.std(ddof=1) / np.sqrt(len(walked))) ** 2)
half = np.sqrt(sum(variances)) / len(steps)
out["step_rate_hz"] = {"value": np.mean(rates), "per": rates, "ci95": [np.mean(rates) - half, np.mean(rates) + half]}

spline = interpolate.CubicSpline(t[w], roll[w])
rate, acceleration = spline(t[w], 1)[4:-4], spline(t[w], 2)[4:-4]
weight, sine = total[4:-4], np.sin(roll[w])[4:-4]
apart = [f[i][4:-4] - weight / 3 for i in range(2)]


def fit(columns):
    matrix = np.array(columns).T
    found, *_ = np.linalg.lstsq(matrix, acceleration, rcond=None)
    left = acceleration - matrix @ found
    return found, 1 - np.sum(left**2) / np.sum((acceleration - acceleration.mean()) ** 2)


plain, r2 = fit([-weight * sine, -rate])
_, with_differences = fit([-weight * sine, -rate, *apart])
spectral = power[1:].sum()
out["mechanism"] = {
    "a": plain[0],
    "b_per_s": plain[1],
    "r2": r2,
    "delta_n_gain": with_differences - r2,
    "share_at_half": near(hz[peak] / 2) / spectral,
    "share_at_f": near(hz[peak]) / spectral,
}


def plainly(x):
    if isinstance(x, dict):
        return {k: plainly(v) for k, v in x.items()}
    if isinstance(x, (list, np.ndarray)):
        return [plainly(v) for v in x]
    return float(x)


made = {"numpy": np.__version__, "scipy": scipy.__version__, "metrics": plainly(out)}
json.dump(made, sys.stdout, indent=1)
print()
