#!/usr/bin/env python3
"""Scores of stymo-eval by skin tone, as a Markdown table.

usage: skin_tones.py SCORES FOLDER [SCORE]; SCORES is the scores.jsonl of stymo-eval, FOLDER has the
photos' images/ and CelebAMask-HQ's class maps in parsing/. SCORE is a score of the head (psnr).

A photo's tone is its individual typology angle, atan((L - 50) / b) of the medians of the skin's CIE
L* and b* (D65), in the classes of Chardon et al. 1991. Hard or coloured light moves it.
"""

import json
import pathlib
import sys

import numpy
from PIL import Image

SKIN, NOSE = 1, 2
CLASSES = [("very light", 55), ("light", 41), ("intermediate", 28), ("tan", 10),
           ("brown or dark", -90)]
XYZ_FROM_RGB = numpy.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722],
                            [0.0193, 0.1192, 0.9505]])
WHITE = numpy.array([0.9505, 1.0, 1.089])


def typology_angle(colors):
    """Degrees, for an array (pixels, 3) of sRGB values in [0, 1]."""
    linear = numpy.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)
    relative = linear @ XYZ_FROM_RGB.T / WHITE
    f = numpy.where(relative > 0.008856, numpy.cbrt(relative), 7.787 * relative + 16 / 116)
    lightness = 116 * numpy.median(f[:, 1]) - 16
    yellow = 200 * numpy.median(f[:, 1] - f[:, 2])
    return numpy.degrees(numpy.arctan2(lightness - 50, max(yellow, 1e-6)))


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[2])
    score = sys.argv[3] if len(sys.argv) == 4 else "psnr"
    groups, stages = {name: [] for name, _ in CLASSES}, []
    for line in pathlib.Path(sys.argv[1]).read_text().splitlines():
        face = json.loads(line)
        photo = next((folder / "images").glob(face["id"] + ".*"))
        classes = numpy.asarray(Image.open(folder / "parsing" / (face["id"] + ".png")))
        image = Image.open(photo).convert("RGB").resize(classes.shape[::-1])
        skin = numpy.isin(classes, (SKIN, NOSE))
        if not skin.any():
            print(face["id"] + ": its parsing has no skin", file=sys.stderr)
            continue
        angle = typology_angle(numpy.asarray(image)[skin] / 255.0)
        name = next(name for name, lowest in CLASSES if angle >= lowest)
        stages = [codes for codes in ("initial", "fitted", "tuned") if codes in face["head"]]
        scores = [face["head"][codes][score] for codes in stages]
        if None not in scores:
            groups[name].append(scores)
    print("| skin | photos |" + "".join(f" {score} {codes} |" for codes in stages))
    print("|---|---|" + "---|" * len(stages))
    for name, values in groups.items():
        if values:
            means = "".join(f" {mean:.3f} |" for mean in numpy.mean(values, axis=0))
            print(f"| {name} | {len(values)} |{means}")


if __name__ == "__main__":
    main()
