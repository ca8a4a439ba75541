#!/usr/bin/env python3
"""Error and run time of a face that is driven by a film, as a Markdown table.

A face does what the coefficients of a made-up recording say; its film then drives a second face,
whose own film from the same coefficients is the truth. usage: film_error.py BIN FOLDER
[--identity WEIGHTS]; BIN is the folder of the tools.
"""

import argparse
import json
import math
import pathlib
import subprocess

FRAMES = 72
SHAPES = """eyeBlinkLeft eyeLookDownLeft eyeLookInLeft eyeLookOutLeft eyeLookUpLeft eyeSquintLeft
eyeWideLeft eyeBlinkRight eyeLookDownRight eyeLookInRight eyeLookOutRight eyeLookUpRight
eyeSquintRight eyeWideRight jawForward jawRight jawLeft jawOpen mouthClose mouthFunnel mouthPucker
mouthRight mouthLeft mouthSmileLeft mouthSmileRight mouthFrownLeft mouthFrownRight
mouthDimpleLeft mouthDimpleRight mouthStretchLeft mouthStretchRight mouthRollLower mouthRollUpper
mouthShrugLower mouthShrugUpper mouthPressLeft mouthPressRight mouthLowerDownLeft
mouthLowerDownRight mouthUpperUpLeft mouthUpperUpRight browDownLeft browDownRight browInnerUp
browOuterUpLeft browOuterUpRight cheekPuff cheekSquintLeft cheekSquintRight noseSneerLeft
noseSneerRight tongueOut""".split()


def recording(speaks):
    """A head that turns and nods and, if it speaks, opens its mouth, smiles and blinks."""
    header = [name[0].upper() + name[1:] for name in SHAPES]
    lines = [",".join(["Timecode", "BlendShapeCount", *header, "HeadYaw", "HeadPitch", "HeadRoll"])]
    for i in range(FRAMES):
        t = i / 25
        value = dict.fromkeys(SHAPES, 0.0)
        if speaks:
            value["jawOpen"] = 0.4 * (1 - math.cos(3 * math.pi * t))
            value["mouthSmileLeft"] = value["mouthSmileRight"] = 0.5 * (1 - math.cos(math.pi * t))
            value["mouthPucker"] = max(0.0, 0.8 * math.sin(1.4 * math.pi * t))
            value["eyeBlinkLeft"] = value["eyeBlinkRight"] = float(i % 40 in (20, 21, 22))
        head = [0.35 * math.sin(0.5 * math.pi * t), 0.1 * math.sin(2 / 3 * math.pi * t),
                0.08 * math.sin(0.4 * math.pi * t)]
        cells = [f"{number:.3f}" for number in [*value.values(), *head]]
        lines.append(",".join([f"00:00:{i // 25:02d}:{i % 25:02d}.000", "61", *cells]))
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--identity", help="weights of MobileFaceNet")
    o = parser.parse_args()
    o.folder.mkdir(parents=True, exist_ok=True)

    def drive(out, face, *options):
        command = [o.bin / "stymo-drive", "--json", "--codes", o.folder / f"faces/{face:04}.json",
                   "--out", o.folder / out, *options]
        if o.identity:
            command += ["--identity", o.identity]
        return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)

    def row(name, result):
        # Null: no frame showed what was to be measured.
        cells = [result.get(key) for key in
                 ("mouth_error", "face_error", "identity", "jitter", "jitter_given",
                  "frames_a_second")]
        print("|", " | ".join([name, *("" if x is None else f"{x:.2f}" for x in cells)]), "|",
              flush=True)

    subprocess.run([o.bin / "stymo-render", "--sample", "4", "--seed", "3", "--truncation", "0.8",
                    "--out", o.folder / "faces"], check=True, capture_output=True)
    for name, speaks in (("speech", True), ("still", False)):
        (o.folder / f"{name}.csv").write_text(recording(speaks))
    speech = ["--coefficients", o.folder / "speech.csv", "--rate", "25"]
    drive("film.mp4", 1, *speech)
    drive("truth.mp4", 2, *speech)
    truth = ["--truth", o.folder / "truth.mp4"]
    print("| | mouth, % | face, % | identity | jitter, % | the film's | frames/s |")
    print("|---" * 7 + "|")
    row("no expression", drive("still.mp4", 2, "--coefficients", o.folder / "still.csv",
                               "--rate", "25", *truth))
    row("by the film", drive("driven.mp4", 2, "--video", o.folder / "film.mp4", "--measure",
                             *truth))


if __name__ == "__main__":
    main()
