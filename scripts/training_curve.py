#!/usr/bin/env python3
"""Draws the losses of trainings that continue each other, from their stats.jsonl, as an SVG.

Needs Debian's python3-matplotlib. usage: training_curve.py OUT.svg RUN[:NAME]...
"""
import json
import pathlib
import sys

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "stymo", "font.size": 9})
shown = [("photometric", "L1, images in [-1, 1]"), ("perceptual", "LPIPS")]


def ticks_of(run: pathlib.Path) -> list[dict]:
    return [json.loads(line) for line in (run / "stats.jsonl").read_text().splitlines()]


def main() -> int:
    if len(sys.argv) < 3:
        print(__doc__, file=sys.stderr)
        return 2
    figure, axes = plt.subplots(1, 2, figsize=(8, 3), layout="constrained")
    images_before = 0.0
    for argument in sys.argv[2:]:
        path, _, name = argument.partition(":")
        ticks = ticks_of(pathlib.Path(path))
        for resolution in sorted({tick["resolution"] for tick in ticks}):
            part = [tick for tick in ticks if tick["resolution"] == resolution]
            # Steps of faces-256 have eight images.
            images = [(images_before + 8 * tick["step"]) / 1000 for tick in part]
            for axis, (key, _) in zip(axes, shown):
                axis.plot(images, [tick[key] for tick in part], linewidth=1,
                          label=f"{name or path}, {resolution} pixels")
        images_before += 8 * ticks[-1]["step"]
    for axis, (_, label) in zip(axes, shown):
        axis.set_xlabel("thousand images")
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    axes[1].margins(y=0.4)  # room for the legend
    axes[1].legend(fontsize=7, loc="upper left", ncols=2)
    figure.savefig(sys.argv[1], metadata={"Date": None})
    return 0


if __name__ == "__main__":
    sys.exit(main())
