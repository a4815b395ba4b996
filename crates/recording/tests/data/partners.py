"""Makes the recordings of further partners' writers: foxglove-sdk (Rust, its own protobuf messages and JSON), mcap-ros1-support.

    pip install foxglove-sdk==0.30.3 mcap-ros1-support==0.9.0  # and what make.py needs
    python partners.py

foxglove.json and ros1_writer.json hold every number as the official Python decoders read it, in the form of expected.json.
"""

import json
import math

import foxglove
from foxglove.mcap import MCAPCompression, MCAPWriteOptions
from foxglove.messages import FrameTransform, FrameTransforms, LocationFix, Pose, PoseInFrame, Quaternion, Timestamp, Vector3
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufFactory
from mcap_ros1.decoder import DecoderFactory as Ros1Factory
from mcap_ros1.writer import Writer as Ros1Writer

from make import COUNT, HERE, definition, everything, flatten, flatten_proto, ros1

START_NS = 1_700_000_000_000_000_000


def time_ns(i):
    return START_NS + i * 100_000_000


def stamp(i):
    return Timestamp(sec=time_ns(i) // 10**9, nsec=time_ns(i) % 10**9)


def transform(i, child):
    return FrameTransform(timestamp=stamp(i), parent_frame_id="world", child_frame_id=child,
                          translation=Vector3(x=0.1 * i, y=-i, z=1e-300), rotation=Quaternion(x=0.0, y=0.0, z=math.sin(i), w=math.cos(i)))


MESSAGES = {
    "/pose": lambda i: PoseInFrame(timestamp=stamp(i), frame_id="f" * i, pose=Pose(position=Vector3(x=i / 3, y=0.0, z=-i), orientation=Quaternion(x=0.5, y=0.5, z=0.5, w=-0.5))),
    "/tf": lambda i: FrameTransforms(transforms=[transform(i, f"child_{k}") for k in range(i % 4)]),
    "/fix": lambda i: LocationFix(timestamp=stamp(i), latitude=48 + i / 7, longitude=-11.5, altitude=500.0 + i, position_covariance=[float(k * i) for k in range(9)]),
}


def as_json(i):
    return {"number": i, "deep": {"half": i / 2, "on": i % 2 == 0}, "list": list(range(i % 3)), "text": "t" * i}


def foxglove_file(name, **options):
    path = HERE / f"{name}.mcap"
    context = foxglove.Context()
    options = MCAPWriteOptions(chunk_size=2048, **options)
    with foxglove.open_mcap(path, allow_overwrite=True, context=context, writer_options=options):
        channels = {}
        for topic, make in MESSAGES.items():
            kind = type(make(0))
            channels[topic] = foxglove.Channel(topic, message_encoding="protobuf", schema=kind.get_schema(), context=context)
        text = foxglove.Channel("/json", schema={"type": "object"}, context=context)
        for i in range(COUNT):
            for topic, make in MESSAGES.items():
                channels[topic].log(make(i).encode(), log_time=time_ns(i))
            text.log(as_json(i), log_time=time_ns(i))
    factory, rows = ProtobufFactory(), []
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            row, i = {}, (message.log_time - START_NS) // 100_000_000
            if channel.message_encoding == "protobuf":
                flatten_proto(factory.decoder_for("protobuf", schema)(message.data), channel.topic, row)
            else:
                flatten(json.loads(message.data), channel.topic, row)
            rows.append((i, row))
            if channel.topic == "/pose":
                assert row["/pose.pose.position.x"] == i / 3 and row["/pose.timestamp.nanos"] == time_ns(i) % 10**9
    return rows


def ros1_file(name):
    """rosbags serialises, mcap-ros1-support writes and reads."""
    path = HERE / f"{name}.mcap"
    kinds = {"/everything": ("test_msgs/msg/Everything", lambda i: everything(ros1, i)), "/imu": ("sensor_msgs/msg/Imu", imu)}
    with open(path, "wb") as file:
        writer = Ros1Writer(file, chunk_size=4096)
        for i in range(COUNT):
            for topic, (kind, make) in kinds.items():
                made = make(i)

                class Message:
                    _type = kind.replace("/msg/", "/")
                    _full_text = definition(ros1, kind, 1)

                    def serialize(self, out, made=made, kind=kind):
                        out.write(bytes(ros1.serialize_ros1(made, kind)))

                writer.write_message(topic, Message(), time_ns(i))
        writer.finish()
    rows = []
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            row, i = {}, (message.log_time - START_NS) // 100_000_000
            decoded = Ros1Factory().decoder_for("ros1", schema)(message.data)
            for field in decoded.__slots__:
                flatten_ros1(getattr(decoded, field), f"{channel.topic}.{field}", row)
            rows.append((i, row))
    return rows


def imu(i):
    import numpy as np

    t = ros1.types
    vector = t["geometry_msgs/msg/Vector3"]
    stamp = t["builtin_interfaces/msg/Time"](sec=time_ns(i) // 10**9, nanosec=time_ns(i) % 10**9)
    return t["sensor_msgs/msg/Imu"](
        header=t["std_msgs/msg/Header"](seq=i, stamp=stamp, frame_id="imu"),
        orientation=t["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=np.arange(9.0),
        angular_velocity=vector(x=math.sin(i), y=-i, z=0.1),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(x=0.0, y=i / 3, z=9.81),
        linear_acceleration_covariance=np.zeros(9),
    )


def flatten_ros1(value, path, out):
    if hasattr(value, "secs"):
        out[f"{path}.sec"], out[f"{path}.nsec"] = float(value.secs), float(value.nsecs)
    elif isinstance(value, bytes):
        for k, inner in enumerate(value):
            out[f"{path}[{k}]"] = float(inner)
    elif isinstance(value, (bool, int, float)):
        out[path] = float(value)
    elif isinstance(value, str):
        pass
    elif isinstance(value, (list, tuple)):
        for k, inner in enumerate(value):
            flatten_ros1(inner, f"{path}[{k}]", out)
    else:
        for field in value.__slots__:
            flatten_ros1(getattr(value, field), f"{path}.{field}", out)


def keep(name, rows):
    signals = {}
    for i, row in rows:
        for path, value in row.items():
            signals.setdefault(path, []).append([i, None if math.isnan(value) else value])
    lines = [f"{json.dumps(path)}: {json.dumps(pairs)}" for path, pairs in signals.items()]
    (HERE / f"{name}.json").write_text("{\n" + ",\n".join(lines) + "\n}\n")
    print(name, len(signals), "signals")


made = foxglove_file("foxglove_zstd")
assert made == foxglove_file("foxglove_lz4", compression=MCAPCompression.Lz4)
assert made == foxglove_file("foxglove_none", compression=None, use_chunks=False)
keep("foxglove", made)
keep("ros1_writer", ros1_file("ros1_writer"))
