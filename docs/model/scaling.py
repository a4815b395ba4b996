#!/usr/bin/env python3
"""The figure of docs/effects.md: time and memory against the number of carriers.

  cargo run --release -p sim --example scaling > scaling.csv && python docs/model/scaling.py scaling.csv
"""
import csv
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

with open(sys.argv[1]) as file:
    rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
n = np.array([r["carriers"] for r in rows])
figure, axes = plt.subplots(1, 3, figsize=(12, 3.2), layout="constrained")
# What is the same for 2 and for 10 carriers is the constant part: both fill whole pairs.
at = {r["carriers"]: r["rhs_ns"] for r in rows}
per_carrier = (at[10] - at[2]) / 8
constant = at[2] - 2 * per_carrier
for axis, (key, label) in zip(axes, (("rhs_ns", "one right-hand side (ns)"), ("cpu_s_for_60_s", "60 s, processor time (s)"), ("peak_mb", "memory (MB)"))):
    axis.loglog(n, [r[key] for r in rows], "o-", color="#0072B2", ms=4)
    axis.set(xlabel="carriers", ylabel=label)
    axis.spines[["top", "right"]].set_visible(False)
axes[0].loglog(n, constant + per_carrier * n, color="#D55E00", lw=1, label=f"{constant:.0f} ns + {per_carrier:.1f} ns × N")
axes[0].legend(frameon=False, fontsize=8)
axes[2].set_ylim(1, 100)
figure.savefig(pathlib.Path(__file__).parent / "scaling.png", dpi=110)
ratio = (at[10_000] - constant) / (at[10] - constant)
print(f"constant {constant:.0f} ns, {per_carrier:.1f} ns a carrier; N = 10,000 takes {ratio:.0f} times N = 10")
