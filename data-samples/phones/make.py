"""Raw files as phones and a sound recorder leave them, out of a simulated recording: NOT recorded by anybody.

    sim record scene.toml --out phones.mcap && python3 make.py phones.mcap

Needs the packages numpy, mcap, mcap-ros2-support and mcap-protobuf-support. rath.zip and carrier_1.zip are laid out as phyphox exports (comma,
decimal point), carrier_2.zip as Sensor Logger does on Android, drum.wav as a recorder does that was switched on three seconds later. Before and
behind the simulated walk stand 12 s of rest with taps on the rath, as docs/field.md asks for: they are made up here, with the simulated sensors'
noise. Gyroscope and accelerometer of a phone are not sampled at the same instants: here they are.
"""
import sys
import wave
import zipfile

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2

REST_S = 12.0
WALK_S = 45.0
# True times of the taps, s; the walk begins at 0.
TAPS_S = [-8.0, -7.37, -7.0, -5.6, 50.2, 50.95, 51.3, 52.6, 53.1]
# What the clocks show: offset (s) and drift, as scene.toml has them.
CLOCKS = {"rath": (0.0, 0.0), "carrier_1": (0.09, 20e-6), "carrier_2": (-0.06, -20e-6)}
# Noise of a sample at 100 Hz, as scene.toml's densities make it, m/s² and rad/s.
ACCEL_NOISE, GYRO_NOISE = 0.018, 0.0012
G = 9.81
# The recorder is switched on so much before the walk begins, s.
SOUND_FROM_S = -9.0
random = np.random.default_rng(1012)


def read(path):
    phones, state, sound = {}, None, []
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[Ros2(), Protobuf()])
        for _, channel, message, m in reader.iter_decoded_messages():
            if channel.topic.startswith("/imu/"):
                w, a = m.angular_velocity, m.linear_acceleration
                row = (message.log_time, (w.x, w.y, w.z), (a.x, a.y, a.z))
                phones.setdefault(channel.topic[5:], []).append(row)
            elif channel.topic == "/rath/state":
                state = m
            elif channel.topic == "/audio/drum":
                rate = m.sample_rate
                sound.append(np.frombuffer(m.data, "<i2"))
    return phones, state, (rate, np.concatenate(sound))


def turn(q, v):
    """v turned by the unit quaternion q = (x, y, z, w)."""
    u, w = np.array(q[:3]), q[3]
    return v + 2 * np.cross(u, np.cross(u, v) + w * v)


def settle(state, t):
    """How the rath comes to rest: angular velocity and specific force in its own axes, t seconds after the walk. It turns level in 3 s and stops
    in half a second."""
    q, v = state.orientation, state.velocity_m_per_s
    q = np.array([q.x, q.y, q.z, q.w]) * (1 if q.w >= 0 else -1)
    angle = 2 * np.arccos(min(q[3], 1.0))
    axis = q[:3] / max(np.linalg.norm(q[:3]), 1e-12)
    s = min(t / 3, 1.0)
    left = angle * (1 - s * s * (3 - 2 * s))
    rate = -angle * 6 * s * (1 - s) / 3
    now = np.append(axis * np.sin(left / 2), np.cos(left / 2))
    stop = -np.array([v.x, v.y, v.z]) / 0.5 if t < 0.5 else np.zeros(3)
    back = now * np.array([-1, -1, -1, 1])
    return axis * rate, turn(back, stop + np.array([0, 0, G]))


def tapped(t):
    """What a knuckle adds: it rings for some hundredths of a second, m/s²."""
    return sum(14 * np.exp(-(t - tap) / 0.02) * np.cos(140 * (t - tap)) for tap in TAPS_S if 0 <= t - tap < 0.15)


def with_rest(phone, rows, state):
    """The rows of a walk with rest before and behind."""
    offset, drift = CLOCKS[phone]
    first = rows[0][0] - round(offset * 1e9)
    knock = random.normal(size=3)
    knock /= np.linalg.norm(knock)

    def row(t):
        rate, force = settle(state, t - WALK_S) if phone == "rath" and t > WALK_S else (np.zeros(3), np.array([0, 0, G]))
        rate = rate + GYRO_NOISE * random.normal(size=3)
        force = force + ACCEL_NOISE * random.normal(size=3) + tapped(t) * knock
        stamp = first + round((t + offset + drift * t) * 1e9)
        return stamp, tuple(rate), tuple(force)

    before = [row(-REST_S + k / 100) for k in range(round(100 * REST_S))]
    behind = [row(WALK_S + k / 100) for k in range(1, round(100 * REST_S))]
    return before + [r for r in rows if r[0] < behind[0][0]] + behind


def pack(name, files):
    with zipfile.ZipFile(name, "w") as archive:
        for inside, text in files.items():
            # Always the same date, so that the same samples give the same bytes.
            entry = zipfile.ZipInfo(inside, date_time=(2026, 1, 1, 0, 0, 0))
            archive.writestr(entry, text, zipfile.ZIP_DEFLATED, 9)


def phyphox(name, rows):
    start = rows[0][0]

    def table(title, unit, column, digits):
        head = ",".join(f'"{title} {axis} ({unit})"' for axis in "xyz")
        lines = [f'"Time (s)",{head}']
        for row in rows:
            values = ",".join(f"{v:.{digits}E}" for v in row[column])
            lines.append(f"{(row[0] - start) / 1e9:.6E},{values}")
        return "\n".join(lines) + "\n"

    pack(name, {
        "Accelerometer.csv": table("Acceleration", "m/s^2", 2, 4),
        "Gyroscope.csv": table("Gyroscope", "rad/s", 1, 4),
        "meta/time.csv": '"event","experiment time","system time","system time text"\n'
                         f'"START",0.000000000E0,{start // 10**6 / 1e3:.3f},"2026-01-01"\n'
                         f'"PAUSE",{(rows[-1][0] - start) / 1e9:.9E},{rows[-1][0] / 1e9:.3f},"2026-01-01"\n',
    })


def sensor_logger(name, rows):
    start = rows[0][0]

    def table(column):
        lines = ["time,seconds_elapsed,z,y,x"]
        for row in rows:
            x, y, z = (f"{v:.5g}" for v in row[column])
            lines.append(f"{row[0]},{(row[0] - start) / 1e9:.3f},{z},{y},{x}")
        return "\n".join(lines) + "\n"

    pack(name, {
        "TotalAcceleration.csv": table(2),
        "Gyroscope.csv": table(1),
        "Metadata.csv": "version,device name,platform,standardisation\n3,phone,android,false\n",
    })


def recorder(name, rate, sound):
    """The drum with rest before and behind, in which the knuckle is heard."""
    def rest(from_s, samples):
        t = from_s + np.arange(samples) / rate
        out = 0.002 * random.normal(size=samples)
        for tap in TAPS_S:
            s = np.where(t >= tap, t - tap, np.inf)
            out += 0.3 * np.exp(-s / 0.012) * np.cos(2 * np.pi * 700 * np.where(np.isfinite(s), s, 0))
        return (32767 * np.clip(out, -1, 1)).astype("<i2")

    whole = np.concatenate([
        rest(SOUND_FROM_S, round(-SOUND_FROM_S * rate)),
        sound,
        rest(len(sound) / rate, round(REST_S * rate)),
    ])
    with wave.open(name, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes(whole.astype("<i2").tobytes())


phones, state, (rate, sound) = read(sys.argv[1])
for phone, rows in sorted(phones.items()):
    (sensor_logger if phone == "carrier_2" else phyphox)(f"{phone}.zip", with_rest(phone, rows, state))
recorder("drum.wav", rate, sound)
