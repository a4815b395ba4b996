"""Makes the recordings in this folder with other people's writers, and expected.json with every number in them.

    pip install mcap==1.6.0 mcap-ros2-support==0.6.0 mcap-protobuf-support==0.6.0 rosbags==0.11.9 protobuf
    python make.py

Each file holds the same channels in another container; the tests compare every value. What is written is also read back here by the
official decoders of ROS 2 and protobuf, so that expected.json is what two independent programs agree on.
"""

import io
import json
import math
import random
import struct
from pathlib import Path

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from mcap_ros2.decoder import DecoderFactory as Ros2Factory
from mcap_protobuf.decoder import DecoderFactory as ProtobufFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

HERE = Path(__file__).parent
COUNT = 24
random.seed(5)

EVERYTHING = """# every form of a field
int32 CONSTANT=5
string TEXT = "a # b"
std_msgs/Header header
bool flag
byte raw
char letter
int8 i8
uint8 u8
int16 i16
uint16 u16
int32 i32
uint32 u32
int64 i64
uint64 u64
float32 f32
float64 f64
string text
float64[3] fixed
int16[<=5] bounded
float32[] loose
string[] texts
Part[2] parts
Part[] more_parts
string<=20 short_text
uint8 last
"""
PART = "string name\nfloat64 value\nuint8[] bytes\ngeometry_msgs/Vector3 vector\n"

ros2 = get_typestore(Stores.ROS2_HUMBLE)
ros1 = get_typestore(Stores.ROS1_NOETIC)
types = get_types_from_msg(PART, "test_msgs/msg/Part")
types.update(get_types_from_msg(EVERYTHING.replace("Part", "test_msgs/Part"), "test_msgs/msg/Everything"))
ros2.register(types)
types1 = get_types_from_msg(PART, "test_msgs/msg/Part")
types1.update(
    get_types_from_msg(
        EVERYTHING.replace("Part", "test_msgs/Part").replace("<=5", "").replace("<=20", ""), "test_msgs/msg/Everything"
    )
)
ros1.register(types1)


def everything(store, i):
    """One message with odd lengths of text, so that every alignment occurs."""
    import numpy as np

    t = store.types
    stamp = t["builtin_interfaces/msg/Time"](sec=1700000000 + i // 10, nanosec=100_000_000 * (i % 10))
    arguments = {"stamp": stamp, "frame_id": "f" * (i % 9)}
    if store is ros1:
        arguments["seq"] = i
    header = t["std_msgs/msg/Header"](**arguments)
    vector = t["geometry_msgs/msg/Vector3"]

    def part(k):
        return t["test_msgs/msg/Part"](
            name="p" * ((i + k) % 5),
            value=i + k / 7,
            bytes=np.arange((i + k) % 4, dtype=np.uint8),
            vector=vector(x=0.1 * i, y=-1.0 / (k + 1), z=1e300),
        )

    return t["test_msgs/msg/Everything"](
        header=header,
        flag=bool(i % 2),
        raw=i,
        letter=65 + i % 26,
        i8=-i,
        u8=200 + i,
        i16=-300 * i,
        u16=60000 + i,
        i32=-(10**9) - i,
        u32=4 * 10**9 + i,
        i64=-(2**53) + i,
        u64=2**53 - i,
        f32=struct.unpack("<f", struct.pack("<f", math.sin(i)))[0],
        f64=math.nan if i == 7 else math.cos(i),
        text="t" * (i % 13),
        fixed=np.array([i, i / 3, -i / 7]),
        bounded=np.array(range(i % 6), dtype=np.int16) * -7,
        loose=np.linspace(0, i, i % 7, dtype=np.float32),
        texts=["x" * k for k in range(i % 4)],
        parts=[part(0), part(1)],
        more_parts=[part(k) for k in range(i % 3)],
        short_text="short"[: i % 6],
        last=i,
    )


def imu(store, i):
    import numpy as np

    t = store.types
    stamp = t["builtin_interfaces/msg/Time"](sec=1700000000 + i // 10, nanosec=100_000_000 * (i % 10))
    vector = t["geometry_msgs/msg/Vector3"]
    return t["sensor_msgs/msg/Imu"](
        header=t["std_msgs/msg/Header"](stamp=stamp, frame_id="imu_link"),
        orientation=t["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=np.array([-1.0] + [0.0] * 8),
        angular_velocity=vector(x=random.gauss(0, 1), y=random.gauss(0, 1), z=random.gauss(0, 1)),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(x=random.gauss(0, 1), y=random.gauss(0, 1), z=9.81),
        linear_acceleration_covariance=np.zeros(9),
    )


def flatten(value, path, out, ros1_time=False):
    """Every number of a message by its path, in the way of the object at hand."""
    if isinstance(value, (bool, int, float)) or type(value).__module__ == "numpy" and getattr(value, "shape", None) == ():
        out[path] = float(value)
    elif value is None or isinstance(value, str):
        pass
    elif isinstance(value, dict):
        for key, inner in value.items():
            flatten(inner, f"{path}.{key}", out, ros1_time)
    elif hasattr(value, "__iter__"):
        for i, inner in enumerate(value):
            flatten(inner, f"{path}[{i}]", out, ros1_time)
    else:
        names = getattr(value, "__slots__", None) or [n for n in vars(value) if not n.startswith("_")]
        for name in names:
            if name.startswith("_") or name.isupper():
                continue
            shown = name
            if ros1_time and name == "nanosec":
                shown = "nsec"
            flatten(getattr(value, name), f"{path}.{shown}", out, ros1_time)


# --- protobuf: every kind of field, in two files that import each other's parts ---
def proto_files():
    F = descriptor_pb2.FieldDescriptorProto
    part = descriptor_pb2.FileDescriptorProto(name="part.proto", package="test.part", syntax="proto3")
    m = part.message_type.add(name="Part")
    m.field.add(name="value", number=1, type=F.TYPE_DOUBLE, label=1)
    m.field.add(name="name", number=2, type=F.TYPE_STRING, label=1)
    m.field.add(name="inner", number=3, type=F.TYPE_MESSAGE, type_name=".test.part.Part", label=1)

    top = descriptor_pb2.FileDescriptorProto(name="top.proto", package="test", syntax="proto3")
    top.dependency.extend(["part.proto", "google/protobuf/timestamp.proto"])
    e = top.enum_type.add(name="Color")
    for k, name in enumerate(["RED", "GREEN", "BLUE"]):
        e.value.add(name=name, number=k)
    m = top.message_type.add(name="Top")
    m.field.add(name="timestamp", number=1, type=F.TYPE_MESSAGE, type_name=".google.protobuf.Timestamp", label=1)
    kinds = "DOUBLE FLOAT INT32 INT64 UINT32 UINT64 SINT32 SINT64 FIXED32 FIXED64 SFIXED32 SFIXED64 BOOL".split()
    for k, kind in enumerate(kinds):
        m.field.add(name="a_" + kind.lower(), number=10 + k, type=getattr(F, "TYPE_" + kind), label=1)
        m.field.add(name="r_" + kind.lower(), number=40 + k, type=getattr(F, "TYPE_" + kind), label=3)
    loose = m.field.add(name="unpacked", number=70, type=F.TYPE_SINT32, label=3)
    loose.options.packed = False
    m.field.add(name="color", number=2, type=F.TYPE_ENUM, type_name=".test.Color", label=1)
    m.field.add(name="text", number=3, type=F.TYPE_STRING, label=1)
    m.field.add(name="part", number=4, type=F.TYPE_MESSAGE, type_name=".test.part.Part", label=1)
    m.field.add(name="parts", number=2000, type=F.TYPE_MESSAGE, type_name=".test.part.Part", label=3)
    for name, number, value in [("weights", 80, "d"), ("named", 81, "m")]:
        entry = m.nested_type.add(name=name.capitalize() + "Entry")
        entry.options.map_entry = True
        entry.field.add(name="key", number=1, type=F.TYPE_STRING if value == "d" else F.TYPE_INT32, label=1)
        if value == "d":
            entry.field.add(name="value", number=2, type=F.TYPE_DOUBLE, label=1)
        else:
            entry.field.add(name="value", number=2, type=F.TYPE_MESSAGE, type_name=".test.part.Part", label=1)
        m.field.add(name=name, number=number, type=F.TYPE_MESSAGE, type_name=f".test.Top.{entry.name}", label=3)
    m.oneof_decl.add(name="choice")
    m.field.add(name="this", number=90, type=F.TYPE_INT32, label=1, oneof_index=0)
    m.field.add(name="that", number=91, type=F.TYPE_DOUBLE, label=1, oneof_index=0)
    m.oneof_decl.add(name="_maybe")
    m.field.add(name="maybe", number=92, type=F.TYPE_DOUBLE, label=1, oneof_index=1, proto3_optional=True)
    stamp = descriptor_pb2.FileDescriptorProto()
    from google.protobuf import timestamp_pb2

    timestamp_pb2.DESCRIPTOR.CopyToProto(stamp)
    return top, part, stamp


top, part, stamp = proto_files()
pool = descriptor_pool.DescriptorPool()
for file in (stamp, part, top):
    pool.Add(file)
Top = message_factory.GetMessageClass(pool.FindMessageTypeByName("test.Top"))
# The importing file comes first: readers must not depend on the order.
PROTO_SET = descriptor_pb2.FileDescriptorSet(file=[top, part, stamp]).SerializeToString()


def proto(i):
    m = Top()
    m.timestamp.seconds = 1700000000 + i // 10
    m.timestamp.nanos = 100_000_000 * (i % 10)
    if i % 3:
        m.a_double, m.a_float = math.sin(i), struct.unpack("<f", struct.pack("<f", math.cos(i)))[0]
        m.a_int32, m.a_int64, m.a_uint32, m.a_uint64 = -i, -(2**50) - i, 4 * 10**9 + i, 2**53 - i
        m.a_sint32, m.a_sint64, m.a_fixed32, m.a_fixed64 = -i * 1000, -(2**40) + i, 4 * 10**9, 2**52 + i
        m.a_sfixed32, m.a_sfixed64, m.a_bool = -5 * i, -(2**45), bool(i % 2)
    for k in range(i % 4):
        m.r_double.append(k / 3)
        m.r_int32.append(-k)
        m.r_bool.append(k % 2 == 0)
        m.r_sint64.append(-k * i)
        m.r_fixed32.append(k)
        m.unpacked.append(-k)
    m.color = i % 3
    m.text = "x" * i
    if i % 2:
        m.part.value = i
        m.part.inner.value = -i
    for k in range(i % 3):
        m.parts.add(value=k + 0.5, name="p")
    m.weights["a"] = i
    if i % 2:
        m.weights["b.c"] = 0.0
    m.named[-3].value = 2 * i
    if i % 2:
        m.this = i
    else:
        m.that = i / 2
    if i % 5 == 0:
        m.maybe = 0.0
    return m


def flatten_proto(m, path, out):
    for field in m.DESCRIPTOR.fields:
        p = f"{path}.{field.name}"
        if field.message_type and field.message_type.GetOptions().map_entry:
            for key, value in getattr(m, field.name).items():
                if hasattr(value, "DESCRIPTOR"):
                    flatten_proto(value, f"{p}[{key}]", out)
                else:
                    out[f"{p}[{key}]"] = float(value)
        elif field.is_repeated:
            for k, value in enumerate(getattr(m, field.name)):
                if hasattr(value, "DESCRIPTOR"):
                    flatten_proto(value, f"{p}[{k}]", out)
                else:
                    out[f"{p}[{k}]"] = float(value)
        elif field.message_type:
            if m.HasField(field.name):
                flatten_proto(getattr(m, field.name), p, out)
        elif field.type in (field.TYPE_STRING, field.TYPE_BYTES):
            pass
        elif not field.has_presence or m.HasField(field.name):
            out[p] = float(getattr(m, field.name))


def as_json(i):
    return {
        "header": {"stamp": {"sec": 1700000000 + i // 10, "nanosec": 100_000_000 * (i % 10)}},
        "value": math.sin(i),
        "big": 2**53 - i,
        "flag": bool(i % 2),
        "none": None,
        "text": "ü\n" * (i % 3),
        "list": [k / 3 for k in range(i % 5)],
        "parts": [{"x": k, "deep": {"y": [-k, [k]]}} for k in range(i % 3)],
    }


IDL = """IDL: test_msgs/msg/Small
// generated
#include "geometry_msgs/msg/Vector3.idl"
module test_msgs {
  module msg {
    module Small_Constants { const uint8 SIZE = 3; };
    typedef double double__3[3];
    @verbatim (language="comment", text=
      "a comment (with brackets)")
    struct Small {
      int32 number;
      string text;
      @unit (value="m") geometry_msgs::msg::Vector3 vector;
      double__3 fixed;
      sequence<float> loose;
      sequence<geometry_msgs::msg::Vector3, 4> vectors;
      boolean flag;
    };
  };
};
================================================================================
IDL: geometry_msgs/msg/Vector3
module geometry_msgs { module msg { struct Vector3 { double x; double y; double z; }; }; };
"""
SMALL = "int32 number\nstring text\ngeometry_msgs/Vector3 vector\nfloat64[3] fixed\nfloat32[] loose\ngeometry_msgs/Vector3[] vectors\nbool flag\n"
ros2.register(get_types_from_msg(SMALL, "test_msgs/msg/Small"))


def small(i):
    import numpy as np

    t = ros2.types
    vector = t["geometry_msgs/msg/Vector3"]
    return t["test_msgs/msg/Small"](
        number=-i,
        text="s" * (i % 7),
        vector=vector(x=i, y=-i, z=i / 3),
        fixed=np.array([1.0, 2.0, i]),
        loose=np.linspace(0, 1, i % 4, dtype=np.float32),
        vectors=[vector(x=k, y=k + 1, z=i) for k in range(i % 3)],
        flag=i % 2 == 1,
    )


class Xcdr2:
    """Plain XCDR2 by the standard: alignment to at most 4, a size before sequences of structs."""

    def __init__(self, endian):
        self.endian, self.body = endian, b""

    def put(self, code, value):
        size = min(struct.calcsize(code), 4)
        self.body += b"\0" * (-len(self.body) % size)
        self.body += struct.pack(self.endian + code, value)

    def small(self, m):
        self.put("i", m.number)
        self.put("I", len(m.text) + 1)
        self.body += m.text.encode() + b"\0"
        for value in [m.vector.x, m.vector.y, m.vector.z, *m.fixed]:
            self.put("d", value)
        self.put("I", len(m.loose))
        for value in m.loose:
            self.put("f", value)
        self.put("I", 4 + 4 * 0 + 24 * len(m.vectors))
        self.put("I", len(m.vectors))
        for v in m.vectors:
            for value in (v.x, v.y, v.z):
                self.put("d", value)
        self.put("B", m.flag)
        return self.body


def definition(store, name, version):
    return store.generate_msgdef(name, ros_version=version)[0]


def channels():
    """Topic, message encoding, schema (name, encoding, data) or None, the messages, the expected numbers."""
    out = []

    def add(topic, encoding, schema, encode, flat):
        out.append((topic, encoding, schema, [encode(i) for i in range(COUNT)], [flat(i) for i in range(COUNT)]))

    def flat_ros(store, make, topic, **k):
        made = [make(store, i) if make in (everything, imu) else make(i) for i in range(COUNT)]

        def flat(i):
            row = {}
            flatten_fields(made[i], topic, row, **k)
            return row

        return made, flat

    def flatten_fields(message, topic, row, ros1_time=False):
        for name in message.__dataclass_fields__:
            if name.startswith("_") or name.isupper():
                continue
            value = getattr(message, name)
            flatten_ros(value, f"{topic}.{name}", row, ros1_time)

    def flatten_ros(value, path, row, ros1_time):
        if hasattr(value, "__dataclass_fields__"):
            for name in value.__dataclass_fields__:
                if name.startswith("_") or name.isupper():
                    continue
                shown = "nsec" if ros1_time and name == "nanosec" else name
                flatten_ros(getattr(value, name), f"{path}.{shown}", row, ros1_time)
        elif isinstance(value, str):
            pass
        elif hasattr(value, "__len__"):
            for k, inner in enumerate(value):
                flatten_ros(inner, f"{path}[{k}]", row, ros1_time)
        else:
            row[path] = float(value)

    name = "test_msgs/msg/Everything"
    text = definition(ros2, name, 2)
    for topic, little in [("/cdr/le", True), ("/cdr/be", False)]:
        made, flat = flat_ros(ros2, everything, topic)
        add(topic, "cdr", (name, "ros2msg", text.encode()), lambda i: bytes(ros2.serialize_cdr(made[i], name, little_endian=little)), flat)
    made_imu, flat = flat_ros(ros2, imu, "/imu")
    add("/imu", "cdr", ("sensor_msgs/msg/Imu", "ros2msg", definition(ros2, "sensor_msgs/msg/Imu", 2).encode()),
        lambda i: bytes(ros2.serialize_cdr(made_imu[i], "sensor_msgs/msg/Imu")), flat)
    made1, flat = flat_ros(ros1, everything, "/ros1", ros1_time=True)
    add("/ros1", "ros1", ("test_msgs/Everything", "ros1msg", definition(ros1, name, 1).encode()),
        lambda i: bytes(ros1.serialize_ros1(made1[i], name)), flat)
    idl_schema = ("test_msgs/msg/Small", "ros2idl", IDL.encode())
    made_small, flat = flat_ros(ros2, small, "/idl")
    add("/idl", "cdr", idl_schema, lambda i: bytes(ros2.serialize_cdr(made_small[i], "test_msgs/msg/Small")), flat)
    for topic, endian, code in [("/xcdr2/le", "<", 7), ("/xcdr2/be", ">", 6)]:
        made_two, flat = flat_ros(ros2, small, topic)
        add(topic, "cdr", idl_schema, lambda i: bytes([0, code, 0, 0]) + Xcdr2(endian).small(made_two[i]), flat)

    def flat_proto(i):
        row = {}
        flatten_proto(proto(i), "/protobuf", row)
        return row

    add("/protobuf", "protobuf", ("test.Top", "protobuf", PROTO_SET), lambda i: proto(i).SerializeToString(), flat_proto)

    def flat_json(topic):
        def flat(i):
            row = {}
            flatten(as_json(i), topic, row)
            return row

        return flat

    add("/json", "json", ("test.Json", "jsonschema", b'{"type": "object"}'), lambda i: json.dumps(as_json(i)).encode(), flat_json("/json"))
    add("/json/schemaless", "json", None, lambda i: json.dumps(as_json(i)).encode(), flat_json("/json/schemaless"))
    return out


CONTAINERS = {
    "zstd": dict(compression=CompressionType.ZSTD, chunk_size=4096),
    "lz4": dict(compression=CompressionType.LZ4, chunk_size=4096),
    "none": dict(compression=CompressionType.NONE, chunk_size=4096),
    "one_chunk": dict(compression=CompressionType.ZSTD, chunk_size=1 << 20),
    "tiny_chunks": dict(compression=CompressionType.LZ4, chunk_size=100),
    "no_crc": dict(compression=CompressionType.ZSTD, chunk_size=4096, enable_crcs=False, enable_data_crcs=False),
    "no_index": dict(compression=CompressionType.ZSTD, chunk_size=4096, index_types=IndexType.NONE, use_statistics=False,
                     repeat_channels=False, repeat_schemas=False, use_summary_offsets=False),
    "no_statistics": dict(compression=CompressionType.NONE, chunk_size=4096, use_statistics=False),
    "unchunked": dict(use_chunking=False, enable_data_crcs=True),
    "unchunked_bare": dict(use_chunking=False, use_statistics=False, repeat_channels=False, repeat_schemas=False,
                           index_types=IndexType.NONE, use_summary_offsets=False),
}


def write(path, made, options):
    with open(path, "wb") as file:
        writer = Writer(file, **options)
        writer.start("", "rath test data")
        ids = []
        for topic, encoding, schema, _, _ in made:
            schema_id = writer.register_schema(*schema) if schema else 0
            ids.append(writer.register_channel(topic, encoding, schema_id))
        for i in range(COUNT):
            for id_, (_, _, _, messages, _) in zip(ids, made):
                t = 1_700_000_000_000_000_000 + i * 100_000_000
                writer.add_message(id_, t, messages[i], t + 5, i)
        writer.add_attachment(0, 0, "notes.txt", "text/plain", b"hello")
        writer.add_metadata("about", {"key": "value"})
        writer.finish()


def same(a, b):
    return a == b or math.isnan(a) and math.isnan(b)


def check(path, made):
    """The official decoders agree with what was put in."""
    expected = {topic: rows for topic, _, _, _, rows in made}
    seen = {}
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            row = {}
            if channel.message_encoding == "cdr" and schema.encoding == "ros2msg" and channel.topic != "/cdr/be":
                decoded = Ros2Factory().decoder_for("cdr", schema)(message.data)
                for name in decoded.__slots__:
                    flatten(getattr(decoded, name), f"{channel.topic}.{name}", row)
            elif channel.message_encoding == "protobuf":
                flatten_proto(ProtobufFactory().decoder_for("protobuf", schema)(message.data), channel.topic, row)
            else:
                continue
            wanted = expected[channel.topic][message.sequence]
            assert row.keys() == wanted.keys(), (channel.topic, row.keys() ^ wanted.keys())
            assert all(same(row[key], wanted[key]) for key in row), channel.topic
            seen[channel.topic] = seen.get(channel.topic, 0) + 1
    assert len(seen) == 3 and set(seen.values()) == {COUNT}, seen


def main():
    made = channels()
    for name, options in CONTAINERS.items():
        write(HERE / f"{name}.mcap", made, options)
    check(HERE / "zstd.mcap", made)
    check(HERE / "lz4.mcap", made)
    signals = {}
    for _, _, _, _, rows in made:
        for i, row in enumerate(rows):
            for path, value in row.items():
                signals.setdefault(path, []).append([i, None if math.isnan(value) else value])
    # One line per signal: [message, value] pairs; null is NaN.
    lines = [f"{json.dumps(path)}: {json.dumps(pairs)}" for path, pairs in signals.items()]
    (HERE / "expected.json").write_text("{\n" + ",\n".join(lines) + "\n}\n")
    print(len(signals), "signals")


if __name__ == "__main__":
    main()
