#!/usr/bin/env python3
"""Draws the curves of a report of stymo-bench as SVG files.

Needs Debian's python3-matplotlib. usage: plot_reports.py FOLDER [OUT]
FOLDER has the CSV files that `stymo-bench report|curve|render|all --out FOLDER` wrote; the plots go
to OUT, or beside them. Prints the name of each plot.
"""
import csv
import dataclasses
import math
import pathlib
import sys

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "stymo", "font.size": 9})

Points = list[tuple[float, float, str]]  # x, y, text beside the point


@dataclasses.dataclass
class Plot:
    """One line for each value of `series` in the rows of a table."""
    name: str
    table: str
    title: str
    series: str
    x: str
    x_label: str
    y: str
    y_label: str
    x_unit: float = 1.0
    scales: tuple[str, str] = ("log", "log")
    label: str = ""
    face: bool = False  # the mean over the faces


plots = [
    Plot("error_against_time", "curve", "Error against frame time", "varied", "median_seconds",
         "time of a frame, ms", "root_mean_square_error",
         "root mean square error against the exact frame (white = 1)", 1e-3, label="value"),
    Plot("rendering_psnr", "curve", "PSNR against frame time", "varied", "median_seconds",
         "time of a frame, ms", "psnr_mean_db",
         "PSNR against the exact frame, dB, mean over the images", 1e-3, ("log", "linear"),
         label="value"),
    Plot("rendering_worst_pixel", "curve", "Worst pixel against frame time", "varied",
         "median_seconds", "time of a frame, ms", "worst_pixel",
         "largest difference in any colour (white = 1)", 1e-3, label="value"),
    Plot("fitting_loss", "fitting_curves", "Loss against seconds of fitting", "way", "seconds",
         "seconds of fitting", "loss", "the paper's loss", scales=("log", "linear"), face=True),
    Plot("fitting_psnr", "fitting_curves", "PSNR against seconds of fitting", "way", "seconds",
         "seconds of fitting", "psnr_db", "PSNR against the photo, dB", scales=("log", "linear"),
         face=True),
    Plot("training_loss", "training_curves", "Loss against seconds of training", "samples",
         "seconds", "seconds of training", "reconstruction_loss",
         "reconstruction loss of held-out heads", scales=("linear", "log")),
]


def number(text: str) -> float:
    return float(text) if text not in ("", "null") else math.nan


def shown(value: float, scale: str) -> bool:
    return math.isfinite(value) and (scale == "linear" or value > 0)


def mean_over_faces(curves: list[Points]) -> Points:
    """At times that are spread evenly on a logarithmic scale, the mean of the faces' states."""
    first = min(curve[1][0] for curve in curves)
    last = sum(curve[-1][0] for curve in curves) / len(curves)
    times = [first * (last / first) ** (i / 32) for i in range(33)]
    state = lambda curve, time: [y for x, y, _ in curve if x <= time or x == curve[0][0]][-1]
    return [(time, sum(state(curve, time) for curve in curves) / len(curves), "")
            for time in times]


def lines_of(plot: Plot, rows: list[dict[str, str]]) -> dict[str, Points]:
    lines: dict[str, dict[str, Points]] = {}
    for row in rows:
        point = (number(row[plot.x]) / plot.x_unit, number(row[plot.y]), row.get(plot.label, ""))
        lines.setdefault(row[plot.series], {}).setdefault(row.get("face", ""), []).append(point)
    means = {name: mean_over_faces(list(faces.values())) if plot.face else faces[""]
             for name, faces in lines.items()}
    return {name: [(x, y, text) for x, y, text in points
                   if shown(x, plot.scales[0]) and shown(y, plot.scales[1])]
            for name, points in means.items()}


def draw(plot: Plot, rows: list[dict[str, str]], file: pathlib.Path) -> None:
    figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    for index, (name, points) in enumerate(lines_of(plot, rows).items()):
        if not points:
            continue
        xs, ys, texts = zip(*points)
        # With more than eight lines the colours repeat.
        axes.plot(xs, ys, marker="o", markersize=3, linewidth=1, color=f"C{index % 8}",
                  linestyle="-" if index < 8 else "--",
                  label=f"N = {name}" if plot.series == "samples" else name)
        for x, y, text in points:
            if text:
                axes.annotate(text, (x, y), xytext=(3, 3), textcoords="offset points", fontsize=7)
    axes.set(title=plot.title, xlabel=plot.x_label, ylabel=plot.y_label, xscale=plot.scales[0],
             yscale=plot.scales[1])
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(file, metadata={"Date": None})
    plt.close(figure)


def main() -> int:
    if not 2 <= len(sys.argv) <= 3:
        print(__doc__, file=sys.stderr)
        return 2
    folder, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[-1])
    drawn = 0
    for plot in plots:
        for table in sorted(folder.glob(f"*_{plot.table}.csv")):
            rows = list(csv.DictReader(table.open(encoding="utf-8")))
            draw(plot, rows, out / f"{plot.name}.svg")
            print(f"{plot.name}.svg")
            drawn += 1
    if drawn == 0:
        print(f"plot_reports.py: {folder}: no table of curves", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
