"""Reads a recording with the decoders that the formats' makers publish, and prints what it found as JSON.

    python decode.py FILE.mcap

Needs mcap, mcap-ros2-support and mcap-protobuf-support from PyPI. For every numeric field of every topic: how many numbers there
are, the least, the greatest, and their mean. Also every text of /robot_description, and the sound of /audio/drum as bytes in hex.
"""

import json
import math
import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2


def numbers(path, value):
    """Every number in a message, with its path."""
    if isinstance(value, (bool, int, float)):
        yield path, float(value)
    elif isinstance(value, (str, bytes)) or value is None:
        return
    elif hasattr(value, "DESCRIPTOR"):
        for field in value.DESCRIPTOR.fields:
            if field.has_presence and not value.HasField(field.name):
                continue
            yield from numbers(f"{path}.{field.name}", getattr(value, field.name))
    elif hasattr(value, "__slots__"):
        for name in value.__slots__:
            yield from numbers(f"{path}.{name}", getattr(value, name))
    else:
        for index, item in enumerate(value):
            yield from numbers(f"{path}[{index}]", item)


def main(file):
    found = {}
    counts = {}
    texts = []
    sound = b""
    with open(file, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[Protobuf(), Ros2()])
        # A topic without messages counts too: its schema must be one that its decoder takes.
        for channel in reader.get_summary().channels.values():
            counts[channel.topic] = 0
        for _schema, channel, message, decoded in reader.iter_decoded_messages():
            assert message.log_time == message.publish_time
            counts[channel.topic] += 1
            if channel.topic == "/robot_description":
                texts.append(decoded.data)
            if channel.topic == "/audio/drum":
                sound += decoded.data
            for path, value in numbers(channel.topic, decoded):
                found.setdefault(path, []).append(value)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        attachments = {a.name: a.data.decode() for a in reader.iter_attachments()}
    summary = {
        path: {"count": len(v), "min": min(v), "max": max(v), "mean": math.fsum(v) / len(v)} for path, v in found.items()
    }
    json.dump(
        {
            "topics": counts,
            "fields": summary,
            "texts": texts,
            "sound": sound.hex(),
            "metadata": metadata,
            "attachments": attachments,
        },
        sys.stdout,
    )


if __name__ == "__main__":
    main(sys.argv[1])
