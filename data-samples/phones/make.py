"""Raw files as phones export them, out of a simulated recording: NOT recorded by anybody.

    sim record scene.toml --out phones.mcap && python3 make.py phones.mcap

Needs the packages mcap and mcap-ros2-support. rath.zip and carrier_1.zip are laid out as phyphox exports (comma, decimal point), carrier_2.zip
as Sensor Logger does on Android. Gyroscope and accelerometer of a phone are not sampled at the same instants: here they are.
"""
import sys
import zipfile

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


def read(path):
    phones = {}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        topics = [f"/imu/{name}" for name in ("rath", "carrier_1", "carrier_2")]
        for _, channel, message, imu in reader.iter_decoded_messages(topics=topics):
            w, a = imu.angular_velocity, imu.linear_acceleration
            row = (message.log_time, (w.x, w.y, w.z), (a.x, a.y, a.z))
            phones.setdefault(channel.topic[5:], []).append(row)
    return phones


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


phones = read(sys.argv[1])
for phone, rows in sorted(phones.items()):
    (sensor_logger if phone == "carrier_2" else phyphox)(f"{phone}.zip", rows)
