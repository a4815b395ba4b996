#!/usr/bin/env python3
"""The figures of docs/model.md: every panel is a recording of a scene that has the effect, made and read here.

  cargo build --release -p sim && python docs/model/figures.py [PATH OF sim]

Needs matplotlib, numpy, mcap, mcap-ros2-support and mcap-protobuf-support.
"""
import pathlib
import subprocess
import sys
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2

HERE = pathlib.Path(__file__).parent
SIM = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "target/release/sim").resolve()
TAU = 2 * np.pi
# Okabe & Ito: told apart by the colour-blind as well.
BLUE, ORANGE, GREEN, RED, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#999999"


def record(scene, *settings, topics=None):
    """Messages of a scene (a built-in name, or TOML) by topic, each with its time in seconds."""
    with tempfile.TemporaryDirectory() as folder:
        if "\n" in scene:
            path = pathlib.Path(folder, "scene.toml")
            path.write_text('name = "figure"\n' + scene)
            scene = str(path)
        out = pathlib.Path(folder, "out.mcap")
        sets = [word for s in settings for word in ("--set", s)]
        subprocess.run([SIM, "record", scene, "--out", out, *sets], check=True, stderr=subprocess.DEVNULL)
        found = {}
        with open(out, "rb") as stream:
            reader = make_reader(stream, decoder_factories=[Protobuf(), Ros2()])
            for _, channel, message, decoded in reader.iter_decoded_messages(topics=topics):
                found.setdefault(channel.topic, []).append((message.log_time * 1e-9, decoded))
        return found


def column(messages, of):
    """Times and one number of each message."""
    return np.array([t for t, _ in messages]), np.array([of(m) for _, m in messages])


def phases(scene, *settings, of=lambda m: m.phase_rad[0]):
    return column(record(scene, *settings, topics=["/carriers/phases"])["/carriers/phases"], of)


def state(scene, *settings, of):
    return column(record(scene, *settings, topics=["/rath/state"])["/rath/state"], of)


def forces(scene, *settings, of):
    return column(record(scene, *settings, topics=["/handles/forces"])["/handles/forces"], of)


def sheet(rows, columns, name, draw):
    figure, axes = plt.subplots(rows, columns, figsize=(4.0 * columns, 3.1 * rows), layout="constrained")
    axes = list(np.ravel(axes))
    for axis, panel in zip(axes, draw):
        axis.set_title(panel.__name__, loc="left", fontsize=10, fontweight="bold")
        panel(axis)
        if axis.get_legend_handles_labels()[0]:
            axis.legend(fontsize=7, frameon=False)
        axis.spines[["top", "right"]].set_visible(False)
    for axis in axes[len(draw) :]:
        axis.set_visible(False)
    figure.savefig(HERE / f"{name}.png", dpi=110)


ONE = "[carriers]\nhandles_m = [[0.0, 0.0, 0.0]]\n"


def frequency_spread(axis):
    text = "duration_s = 0.01\n[carriers]\n[carriers.along_poles]\ncount = 4000\n[effects.gait]\n[effects.frequency_spread]\n"
    _, hz = phases(text, of=lambda m: np.array(m.natural_frequency_rad_per_s) / TAU)
    axis.hist(hz[0], bins=40, density=True, color=BLUE, alpha=0.5, label="4000 carriers")
    f = np.linspace(1.78, 2.22, 200)
    axis.plot(f, np.exp(-0.5 * ((f - 2) / 0.0553) ** 2) / (0.0553 * np.sqrt(TAU)), color=RED, label="normal, 0.0553 Hz")
    axis.set(xlabel="natural frequency (Hz)", ylabel="density (1/Hz)")


def coupling(axis):
    text = """duration_s = 60.0
[carriers]
initial_phase_sd_rad = 3.0
[carriers.along_poles]
count = 1000
[effects.frequency_spread]
[effects.coupling]
"""
    critical = 2 / (np.pi / (0.0553 * TAU * np.sqrt(TAU)))
    for part, colour in ((0.5, GREY), (1.5, BLUE), (3.0, GREEN)):
        t, r = phases(text, f"effects.coupling.strength_rad_per_s={part * critical}", of=lambda m: m.order_parameter)
        axis.plot(t, r, color=colour, label=f"$K_c$ = {part:g} × 2/(π g(0))")
    axis.set(xlabel="time (s)", ylabel="r, 1000 carriers", ylim=(0, 1.02))


def music(axis):
    text = ONE + "[effects.music]\n"
    for beat, colour in ((2.1507, BLUE), (2.35, GREEN), (2.5, ORANGE), (2.8, RED)):
        t, phase = phases("duration_s = 30.0\n" + text, f"effects.music.beat_hz={beat}")
        axis.plot(t, phase / TAU - beat * t, color=colour, label=f"beat {beat:g} Hz")
    axis.axvline(5, color=GREY, lw=0.8)
    axis.set(xlabel="time (s)", ylabel="carrier behind the beat (turns)", ylim=(-9, 0.5))


def noise(axis):
    text = "duration_s = 60.0\n[carriers]\n[carriers.along_poles]\ncount = 1000\n[effects.noise]\n"
    t, phase = phases(text, of=lambda m: np.array(m.phase_rad))
    wander = phase - TAU * 2 * t[:, None]
    axis.plot(t, wander[:, :15], color=BLUE, lw=0.5)
    axis.plot(t, wander.std(axis=1), color="black", lw=2, label="standard deviation of 1000 carriers")
    axis.plot(t, 0.01 * np.sqrt(t), color=RED, lw=1, label="σ√t, σ = 0.01 rad/√s")
    axis.set(xlabel="time (s)", ylabel="φ − ωt (rad)", ylim=(-0.22, 0.28))


def feedback(axis):
    text = """duration_s = 40.0
[carriers]
initial_phase_rad = [0.0, 2.5]
[effects.contact]
[effects.hold]
[effects.gait]
[effects.feedback]
"""
    for strength, colour in ((0.0, GREY), (0.3, BLUE), (1.0, GREEN)):
        t, lag = phases(text, f"effects.feedback.strength_rad_per_s={strength}", of=lambda m: m.phase_rad[1] - m.phase_rad[0])
        axis.plot(t, lag, color=colour, label=f"κ = {strength:g} rad/s")
    axis.axhline(np.pi, color=GREY, lw=0.8, ls=":")
    axis.set(xlabel="time (s)", ylabel="$φ_2 − φ_1$ (rad)")


def shoulder(scene, *settings):
    tf = record(scene, *settings, topics=["/tf"])["/tf"]
    return column(tf, lambda m: m.transforms[1].transform.translation.z)


def gait(axis):
    text = "duration_s = 1.5\nlog_rate_hz = 400.0\n" + ONE + "[effects.gait]\n"
    t, z = shoulder(text)
    axis.plot(t, z, color=BLUE, label="amplitude_m = 0.06")
    shake = "effects.gait.harmonics=[{ order = 4, amplitude_m = [0.0, 0.0, 0.012] }]"
    t, z = shoulder(text, shake)
    axis.plot(t, z, color=ORANGE, label="and a shake of order 4, 12 mm")
    axis.set(xlabel="time (s)", ylabel="shoulder (m)", ylim=(0.92, 1.1))


def lift(axis):
    text = "duration_s = 12.0\nlog_rate_hz = 200.0\n" + ONE + "[effects.gait]\n[effects.lift]\ngain = 1.25\nonset_s = 3.0\nbuild_up_s = 3.0\n"
    t, z = shoulder(text)
    axis.plot(t, z, color=BLUE, lw=0.8)
    late = np.maximum(t - 3, 0)
    axis.plot(t, 1 + 0.06 * (1 + 0.25 * (1 - np.exp(-late / 3))), color=RED, label="1 m + A G(t)")
    axis.axhline(1.06, color=GREY, lw=0.8, ls=":")
    axis.set(xlabel="time (s)", ylabel="shoulder (m)")


def path(axis):
    text = """duration_s = 45.0
[carriers]
walk_m_per_s = [0.8, 0.0, 0.0]
[effects.contact]
[effects.hold]
[effects.pole_friction]
[effects.path]
turn_deg = 90.0
turn_start_s = 10.0
turn_time_s = 20.0
"""
    of = lambda m: (m.position_m.x, m.position_m.y, m.yaw_rad)
    t, p = state(text, of=of)
    axis.plot(p[:, 0], p[:, 1], color=BLUE, lw=0.8, label="centre of mass")
    for x, y, yaw in p[::150]:
        dx, dy = 2.45 * np.cos(yaw), 2.45 * np.sin(yaw)
        axis.plot([x - dx, x + dx], [y - dy, y + dy], color=ORANGE, lw=3, alpha=0.6)
    axis.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")


def contact(axis):
    text = "duration_s = 0.55\nlog_rate_hz = 4000.0\n[start]\nheight_m = 1.0\n[effects.contact]\n"
    laws = (
        ("spring–damper", BLUE, []),
        ("bilateral", GREY, ["effects.contact.bilateral=true"]),
        ("Hunt–Crossley, p = 1.5", GREEN, ['effects.contact.law="hunt-crossley"', "effects.contact.exponent=1.5", "effects.contact.stiffness_n_per_m=8000", "effects.contact.damping_n_s_per_m=1500"]),
    )
    for label, colour, settings in laws:
        _, p = forces(text, *settings, of=lambda m: (m.compression_m[0], m.normal_n[0]))
        axis.plot(1e3 * p[:, 0], p[:, 1], color=colour, lw=1, label=label)
    axis.axhline(0, color="black", lw=0.5)
    axis.set(xlabel="compression δ (mm): dropped from −100", ylabel="N of one handle (N)")


def hold(axis):
    text = "duration_s = 6.0\nlog_rate_hz = 200.0\nfreedom = [\"y\"]\n[start]\nheight_m = 0.9\nposition_m = [0.0, 0.05]\n[effects.hold]\n"
    for damping, colour in ((0.0, GREY), (30.0, GREEN), (150.0, BLUE)):
        t, y = state(text, f"effects.hold.damping_n_s_per_m={damping}", of=lambda m: m.position_m.y)
        axis.plot(t, 1e3 * y, color=colour, lw=1, label=f"$c_t$ = {damping:g} N·s/m")
    axis.set(xlabel="time (s)", ylabel="body sideways (mm)", xlim=(0, 3), ylim=(-56, 88))


def sling(axis):
    messages = record("music", topics=["/rath/state"])["/rath/state"]
    p = np.array([(np.sin(m.roll_rad), m.position_m.y) for t, m in messages if t > 25])
    axis.plot(p[:, 0], 1e3 * p[:, 1], ".", color=BLUE, ms=2, label="scene `music`, t > 25 s")
    s = np.array([-1, 1]) * np.abs(p[:, 0]).max()
    axis.plot(s, -99.5 * s, color=RED, lw=1, label="the paper's logs: −99.5 mm × sin(roll)")
    axis.set(xlabel="sin(roll)", ylabel="body sideways (mm)")


def friction(axis):
    text = "duration_s = 6.0\nlog_rate_hz = 200.0\nfreedom = [\"x\"]\n[start]\nheight_m = 0.8\nvelocity_m_per_s = [1.0, 0.0, 0.0]\n[effects.contact]\n[effects.friction]\n[effects.path]\nslope_deg = 5.0\n"
    for law, colour in (("regularised", BLUE), ("bristle", GREEN)):
        t, x = state(text, f'effects.friction.law="{law}"', of=lambda m: m.position_m.x)
        axis.plot(t, 1e3 * x, color=colour, label=law)
    axis.set(xlabel="time (s)", ylabel="body up a slope of 5° (mm)")
    axis.set_ylim(bottom=0)


def pole_friction(axis):
    text = "duration_s = 20.0\nfreedom = [\"roll\"]\n[effects.contact]\n[effects.sling]\n[effects.pole_friction]\n"
    for start, colour in ((1.0, GREEN), (10.0, BLUE), (40.0, ORANGE)):
        t, roll = state(text, f"start.roll_pitch_yaw_deg=[{start}, 0.0, 0.0]", of=lambda m: m.roll_rad)
        axis.plot(t, np.degrees(roll) / start, color=colour, lw=1, label=f"from {start:g}°")
    axis.set(xlabel="time (s)", ylabel="roll over its start", xlim=(0, 10))


def flexure(axis):
    text = "duration_s = 4.0\nlog_rate_hz = 200.0\n[start]\nheight_m = 1.0\n[effects.contact]\ndamping_n_s_per_m = 100.0\n[effects.hold]\n"
    stiff = state(text, of=lambda m: m.position_m.z)
    bent = state(text + "[effects.flexure]\nfrequency_hz = 4.0\n", of=lambda m: m.position_m.z)
    axis.plot(*stiff, color=GREY, label="a stiff pole")
    axis.plot(*bent, color=BLUE, label="flexure, 4 Hz")
    axis.set(xlabel="time (s)", ylabel="height (m)")


def push(axis):
    text = "duration_s = 3.0\nlog_rate_hz = 200.0\n[body]\nmass_kg = 60.0\n[start]\nheight_m = 50.0\n[effects.push]\npushes = [{ start_s = 1.0, time_s = 0.5 }]\n"
    t, v = state(text, of=lambda m: m.velocity_m_per_s.y)
    u = np.clip((t - 1) / 0.5, 0, 1)
    axis.plot(t, v, color=BLUE, lw=2, label="200 N on 60 kg, half a second")
    axis.plot(t, 200 * 0.5 / 60 * (u / 2 - np.sin(TAU * u) / (4 * np.pi)), color=RED, lw=0.8, label="$F_0$T/M (u/2 − sin 2πu / 4π)")
    axis.set(xlabel="time (s)", ylabel="sideways (m/s)")


def pushed_in_baseline(axis):
    pushes = "effects.push.pushes=[{start_s=20.0, time_s=0.3, force_n=[0.0, 40.0, 0.0], place_m=[0.0, 0.0, -0.3]}]"
    t, roll = state("baseline", pushes, of=lambda m: m.roll_rad)
    axis.plot(t, np.degrees(roll), color=BLUE, lw=1, label="pushed at 20 s")
    axis.set(xlabel="time (s)", ylabel="roll (°)", xlim=(15, 30))


def pushed_in_music(axis):
    pushes = "effects.push.pushes=[{start_s=8.0, time_s=0.3, force_n=[0.0, 40.0, 0.0], place_m=[0.0, 0.0, -0.3]}]"
    for label, colour, settings in (("music", GREY, []), ("pushed at 8 s", BLUE, [pushes])):
        t, roll = state("music", *settings, of=lambda m: m.roll_rad)
        axis.semilogy(t, np.degrees(np.abs(roll)), color=colour, lw=0.8, label=label)
    axis.set(xlabel="time (s)", ylabel="|roll| (°)", xlim=(5, 40), ylim=(1e-2, 60))


def allan(x, rate, sizes):
    """Overlapping Allan deviation (IEEE Std 952-1997, annex C)."""
    total = np.concatenate(([0.0], np.cumsum(x))) / rate
    out = []
    for m in sizes:
        d = total[2 * m :] - 2 * total[m:-m] + total[: -2 * m]
        out.append(np.sqrt(np.mean(d**2) / 2) / (m / rate))
    return np.array(out)


def imu_noise(axis):
    text = "duration_s = 3600.0\nlog_rate_hz = 0.01\n[effects.contact]\n[effects.imu]\nrate_hz = 50.0\nsensors = [{ on = \"rath\" }]\n"
    sensed = record(text, topics=["/imu/rath"])["/imu/rath"]
    _, f = column(sensed, lambda m: (m.linear_acceleration.x, m.linear_acceleration.y, m.linear_acceleration.z))
    sizes = np.unique(np.geomspace(1, 5000, 40).astype(int))
    seen = np.sqrt(np.mean([allan(f[:, a], 50.0, sizes) ** 2 for a in range(3)], axis=0))
    tau = sizes / 50.0
    axis.loglog(tau, seen, color=BLUE, label="accelerometer, 1 h at rest")
    axis.loglog(tau, 2.0e-3 / np.sqrt(tau), color=RED, lw=1, label="$D/\\sqrt{τ}$")
    axis.loglog(tau, 3.0e-3 * np.sqrt(tau / 3), color=ORANGE, lw=1, label="$W\\sqrt{τ/3}$")
    axis.set(xlabel="averaging time τ (s)", ylabel="Allan deviation (m/s²)", ylim=(8e-4, 0.1))


def imu(axis):
    messages = record("field-imu", "duration_s=22.0", topics=["/imu/rath", "/imu/carrier_1"])
    for topic, colour in (("/imu/carrier_1", GREY), ("/imu/rath", BLUE)):
        t, z = column(messages[topic], lambda m: m.linear_acceleration.z)
        late = t > 20
        axis.plot(t[late], z[late], color=colour, lw=1, label=topic)
    axis.axhline(9.81, color=RED, lw=0.8)
    axis.set(xlabel="time (s)", ylabel="specific force, sensor's z (m/s²)", ylim=(-7, 36))


def drum(axis):
    sound = record("field-imu", "duration_s=8.0", topics=["/audio/drum", "/beat"])
    pcm = np.frombuffer(b"".join(m.data for _, m in sound["/audio/drum"]), dtype="<i2") / 32768
    t = np.arange(len(pcm)) / 16000.0
    part = (t > 6.0) & (t < 7.6)
    axis.plot(t[part], pcm[part], color=BLUE, lw=0.4, label="/audio/drum")
    for beat, _ in sound["/beat"]:
        if 6.0 < beat < 7.6:
            axis.axvline(beat, color=RED, lw=1)
    axis.set(xlabel="time (s); vermilion: /beat", ylabel="sound, full scale is 1")


sheet(2, 3, "phases", [frequency_spread, coupling, music, noise, feedback])
sheet(1, 3, "shoulders", [gait, lift, path])
sheet(2, 3, "handles", [contact, hold, sling, friction, pole_friction, flexure])
sheet(1, 3, "push", [push, pushed_in_baseline, pushed_in_music])
sheet(1, 3, "instruments", [imu_noise, imu, drum])
