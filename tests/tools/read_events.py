"""Reads the event files of a run folder with TensorBoard's own reader and lists what it finds; fails if there is nothing.

Needs tensorboard:  python tests/tools/read_events.py RUN
"""

import sys

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.backend.event_processing.event_file_loader import RawEventFileLoader
import pathlib

folder = pathlib.Path(sys.argv[1])
for path in sorted(folder.glob("events.out.tfevents.*")):
    # The loader stops with a DataLossError at a record whose checksum is wrong.
    print(f"{path.name}: {sum(1 for _ in RawEventFileLoader(str(path)).Load())} records")

events = EventAccumulator(str(folder), size_guidance={"scalars": 0, "images": 0})
events.Reload()
for tag in events.Tags()["scalars"]:
    points = events.Scalars(tag)
    print(f"scalar {tag}: {len(points)} points, steps {points[0].step} to {points[-1].step}, last {points[-1].value:g}")
for tag in events.Tags()["images"]:
    images = events.Images(tag)
    sizes = {(image.width, image.height) for image in images}
    signed = all(image.encoded_image_string.startswith(b"\x89PNG") for image in images)
    print(f"image {tag}: {len(images)} pictures, sides {sorted(sizes)}, PNG: {signed}")
if not events.Tags()["scalars"]:
    sys.exit(f"{folder}: no scalars")
