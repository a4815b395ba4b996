#!/usr/bin/env python3
"""Makes scipy.json: what SciPy says, for tests/scipy.rs. Run: python3 make_scipy.py > scipy.json

The signals are made of integers by a linear congruential generator and of sines, so that the test makes
the same ones bit by bit; only SciPy's answers are stored.
"""

import json
import sys

import numpy as np
import scipy
from noise import noise
from scipy import signal


def parts(z):
    return {"re": z.real.tolist(), "im": z.imag.tolist()}


x = noise(1000, 1) + 2.0
y = noise(1000, 2) + 0.5 * np.roll(x, 3)
fs = 30.0
out = {"scipy": scipy.__version__, "numpy": np.__version__, "fs_hz": fs, "samples": 1000}

welch_cases = [
    dict(),
    dict(nperseg=200),
    dict(nperseg=201, noverlap=50),
    dict(window="hamming", nperseg=128, nfft=300),
    dict(window="blackman", nperseg=128, detrend="linear"),
    dict(window="boxcar", nperseg=100, detrend=False),
    dict(window=("tukey", 0.25), nperseg=96, noverlap=12),
    dict(nperseg=128, scaling="spectrum"),
    dict(nperseg=128, average="median"),
    dict(nperseg=4000),
]
out["welch"] = []
for case in welch_cases:
    f, p = signal.welch(x, fs, **case)
    out["welch"].append({"args": case, "hz": f.tolist(), "power": p.tolist()})
out["csd"] = []
for case in [dict(nperseg=200), dict(nperseg=128, average="median"), dict(nperseg=101, detrend="linear", scaling="spectrum")]:
    f, p = signal.csd(x, y, fs, **case)
    out["csd"].append({"args": case, "hz": f.tolist(), **parts(p)})
out["coherence"] = []
for case in [dict(nperseg=128), dict(nperseg=100, noverlap=75, window="hamming")]:
    f, c = signal.coherence(x, y, fs, **case)
    out["coherence"].append({"args": case, "hz": f.tolist(), "value": c.tolist()})
out["spectrogram"] = []
for case in [dict(), dict(nperseg=100), dict(nperseg=128, noverlap=64, window="hann", mode="magnitude")]:
    f, t, s = signal.spectrogram(x, fs, **case)
    out["spectrogram"].append({"args": case, "hz": f.tolist(), "t_s": t.tolist(), "power": s.T.tolist()})
out["hilbert"] = [{"n": n, **parts(signal.hilbert(x[:n]))} for n in (1, 2, 255, 256)]
out["sosfiltfilt"] = []
for order, wn, btype in [
    (1, 3.0, "low"), (4, 3.0, "low"), (5, 3.0, "high"), (2, [1.0, 4.0], "band"),
    (3, [0.5, 1.5], "band"), (4, [1.8, 2.5], "band"), (3, [1.0, 4.0], "bandstop"), (8, 6.0, "high"),
]:
    sos = signal.butter(order, wn, btype, fs=fs, output="sos")
    out["sosfiltfilt"].append({
        "order": order, "corners_hz": wn if isinstance(wn, list) else [wn], "kind": btype,
        "y": signal.sosfiltfilt(sos, x[:400]).tolist(),
    })
f, p = np.fft.rfftfreq(255, 0.033), np.abs(np.fft.rfft(x[:255]))
out["rfft"] = {"n": 255, "dt_s": 0.033, "hz": f.tolist(), "magnitude": p.tolist()}
from scipy.stats import chi2  # noqa: E402

out["chi2"] = [[p, nu, float(chi2.ppf(p, nu))] for nu in (2, 3.7, 16, 118.25, 2000) for p in (0.025, 0.5, 0.975)]
json.dump(out, sys.stdout)
print()
