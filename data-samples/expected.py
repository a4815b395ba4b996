"""Computes the statistics of the sample recordings independently of this project: NumPy and the official MCAP reader.

    pip install numpy mcap mcap-protobuf-support
    python expected.py > expected.json

Definitions: docs/metrics.md, which are those of the paper archive's stats.json.
"""
import json
import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


TOPICS = ["/rath/state", "/carriers/phases", "/handles/forces"]


def statistics(path, start_s=15.0):
    state, phases, forces = [], [], []
    with open(path, "rb") as f:
        for _, channel, message, m in make_reader(f, decoder_factories=[DecoderFactory()]).iter_decoded_messages(TOPICS):
            t = message.log_time * 1e-9
            if channel.topic == "/rath/state":
                state.append((t, m.position_m.z, m.roll_rad, m.pitch_rad, m.yaw_rad))
            elif channel.topic == "/carriers/phases":
                phases.append(list(m.phase_rad))
            elif channel.topic == "/handles/forces":
                forces.append(list(m.normal_n))
    s, p, n = np.array(state), np.array(phases), np.array(forces)
    w = s[:, 0] >= start_s - 1e-9
    s, p, n = s[w], p[w], n[w]
    t, z, roll = s[:, 0], s[:, 1], s[:, 2]
    dt = (t[-1] - t[0]) / (len(t) - 1)
    yc = z - z.mean()
    magnitude, f = np.abs(np.fft.rfft(yc)), np.fft.rfftfreq(len(yc), dt)
    peak = int(np.argmax(magnitude))
    third = len(yc) // 3
    rms = lambda x: float(np.sqrt(np.mean(np.square(x))))
    return {
        "rms_roll_deg": rms(np.degrees(roll)),
        "rms_pitch_deg": rms(np.degrees(s[:, 3])),
        "rms_yaw_deg": rms(np.degrees(s[:, 4])),
        "contact_loss": float(np.mean((n <= 0).any(axis=1))),
        "contact_loss_mean": float(np.mean(n <= 0)),
        "synchrony": float(np.mean(np.abs(np.exp(1j * p).mean(axis=1)))),
        "roll_excess_s": float(np.sum(np.abs(np.degrees(roll)) > 15.0) * dt),
        "dz_pp_m": float(np.ptp(z)),
        "rms_z_m": float(z.std()),
        "z_mean_m": float(z.mean()),
        "t_float": float(np.mean(n.sum(axis=1) <= 0.05 * 60.0 * 9.81)),
        "peak_hz": float(f[peak]),
        "growth_ratio": rms(yc[-third:]) / rms(yc[:third]),
    }


print(json.dumps({name: statistics(name) for name in ("baseline-30s.mcap", "music-30s.mcap")}, indent=2))
