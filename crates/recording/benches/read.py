"""Python's side of `benches/read.rs`: CPU seconds to walk over the yardstick, and to decode it.

    pip install mcap==1.6.0 mcap-ros2-support==0.6.0
    python read.py yardstick.mcap [MESSAGES]

MESSAGES bounds the part that is decoded (it is slow); the time is then scaled to the whole file.
"""

import sys
import time

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

path = sys.argv[1]
limit = int(sys.argv[2]) if len(sys.argv) > 2 else 50_000

start = time.process_time()
with open(path, "rb") as file:
    total = sum(1 for _ in make_reader(file).iter_messages(log_time_order=False))
print(f"mcap: walk over {total} messages: {time.process_time() - start:.2f} s CPU")

start = time.process_time()
with open(path, "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    count, sum_ = 0, 0.0
    for _, _, _, message in reader.iter_decoded_messages(log_time_order=False):
        sum_ += message.angular_velocity.x
        count += 1
        if count == limit:
            break
taken = time.process_time() - start
print(f"mcap + mcap-ros2-support: {taken:.2f} s CPU for {count}, so {taken * total / count:.1f} s for all")
