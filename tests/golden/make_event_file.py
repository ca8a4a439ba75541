"""Writes event_file.tfevents: records as the tensorboard package makes them, with a fixed time.

Needs tensorboard:  python tests/golden/make_event_file.py
"""

import pathlib

from tensorboard.compat.proto.event_pb2 import Event, SessionLog
from tensorboard.compat.proto.summary_pb2 import Summary
from tensorboard.summary.writer.record_writer import RecordWriter

WALL_TIME = 1700000000.25


def scalar(step, tag, value):
    return Event(
        wall_time=WALL_TIME,
        step=step,
        summary=Summary(value=[Summary.Value(tag=tag, simple_value=value)]),
    )


EVENTS = [
    Event(wall_time=WALL_TIME, file_version="brain.Event:2"),
    Event(wall_time=WALL_TIME, step=101, session_log=SessionLog(status=SessionLog.START)),
    scalar(0, "loss", 0.0),
    scalar(150, "loss", 0.125),
    scalar(3000000000, "stage 2/" + 20 * "long name ", -1e-3),
    scalar(150, "not a number", float("nan")),
]

path = pathlib.Path(__file__).parent / "event_file.tfevents"
with open(path, "wb") as file:
    writer = RecordWriter(file)
    for event in EVENTS:
        writer.write(event.SerializeToString(deterministic=True))
    writer.close()
