"""Reads the event files of a run folder with TensorBoard's own reader and lists what it finds;
fails where that stops early.

Needs tensorboard:  python tests/tools/read_events.py RUN
"""

import pathlib
import struct
import sys

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.backend.event_processing.event_file_loader import RawEventFileLoader


def record_count(path):
    """By the lengths alone: 8 bytes of length, 4 of checksum, the data, 4 of checksum."""
    data = path.read_bytes()
    count = at = 0
    while at < len(data):
        at += struct.unpack_from("<Q", data, at)[0] + 16
        count += 1
    return count


folder = pathlib.Path(sys.argv[1])
for path in sorted(folder.glob("events.out.tfevents.*")):
    # TensorBoard's reader ends, without a word, before a record whose checksum is wrong.
    accepted = sum(1 for _ in RawEventFileLoader(str(path)).Load())
    print(f"{path.name}: {accepted} records")
    if accepted != record_count(path):
        sys.exit(f"{path}: only {accepted} of {record_count(path)} records are accepted")

events = EventAccumulator(str(folder), size_guidance={"scalars": 0, "images": 0})
events.Reload()
for tag in events.Tags()["scalars"]:
    points = events.Scalars(tag)
    print(
        f"scalar {tag}: {len(points)} points, steps {points[0].step} to {points[-1].step}, "
        f"last {points[-1].value:g}"
    )
for tag in events.Tags()["images"]:
    images = events.Images(tag)
    sizes = sorted({(image.width, image.height) for image in images})
    signed = all(image.encoded_image_string.startswith(b"\x89PNG") for image in images)
    print(f"image {tag}: {len(images)} images, sides {sizes}, PNG: {signed}")
if not events.Tags()["scalars"]:
    sys.exit(f"{folder}: no scalars")
