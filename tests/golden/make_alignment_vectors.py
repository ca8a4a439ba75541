"""Writes alignment_vectors.json beside this file: squares cut out of a formula's image by FFHQ's
recipe, with Pillow and SciPy.

The image is the closed form `image` below, which tests/fit/photo/test_alignment.cpp repeats, so
only the results are stored. Needs numpy, pillow, scipy (the values stored were made with 2.4, 13.0,
1.17): pip install numpy pillow scipy
"""

import json
import pathlib

import numpy
import PIL.Image
from scipy.ndimage import gaussian_filter


def image(height, width):
    row, column, channel = numpy.meshgrid(
        numpy.arange(height), numpy.arange(width), numpy.arange(3), indexing="ij"
    )
    wave = numpy.sin(0.05 * row + 0.01 * column * (channel + 1)) * numpy.cos(
        0.03 * column + 0.3 * channel
    )
    return numpy.uint8(numpy.floor(255 * (0.5 + 0.45 * wave) + 0.5))


def landmarks_at(center, interocular, degrees, mouth_drop):
    """68 points of which only eyes and mouth corners count; positions of pixel centres are whole
    numbers."""
    points = numpy.zeros((68, 2))
    points[36:42] = [-0.5, 0]
    points[42:48] = [0.5, 0]
    points[48] = [-0.4, mouth_drop]
    points[54] = [0.4, mouth_drop]
    angle = numpy.deg2rad(degrees)
    rotation = numpy.array(
        [[numpy.cos(angle), -numpy.sin(angle)], [numpy.sin(angle), numpy.cos(angle)]]
    )
    return points @ rotation.T * interocular + center


def square(points):
    left_eye, right_eye = points[36:42].mean(0), points[42:48].mean(0)
    eyes = (left_eye + right_eye) / 2
    eye_to_eye = right_eye - left_eye
    eye_to_mouth = (points[48] + points[54]) / 2 - eyes
    x = eye_to_eye - numpy.array([-eye_to_mouth[1], eye_to_mouth[0]])
    x *= max(2.0 * numpy.hypot(*eye_to_eye), 1.8 * numpy.hypot(*eye_to_mouth)) / numpy.hypot(*x)
    return eyes + 0.1 * eye_to_mouth, x, numpy.array([-x[1], x[0]])


def bounds(quad):
    low, high = numpy.floor(quad.min(0)).astype(int), numpy.ceil(quad.max(0)).astype(int)
    return numpy.array([*low, *high])


def aligned(image, points, side):
    c, x, y = square(points)
    quad = numpy.stack([c - x - y, c - x + y, c + x + y, c + x - y])
    size = 2 * numpy.hypot(*x)
    image = PIL.Image.fromarray(image)
    shrink = int(numpy.floor(size / side * 0.5))
    if shrink > 1:
        # FFHQ's own program loses half of a reduced pixel here, and up to a pixel where the factor
        # does not divide the size.
        whole = [length // shrink * shrink for length in image.size]
        image = image.crop((0, 0, *whole)).resize(
            [length // shrink for length in whole], PIL.Image.LANCZOS
        )
        quad = (quad + 0.5) / shrink - 0.5
        size /= shrink
    border = max(int(numpy.rint(size * 0.1)), 3)
    low_x, low_y, high_x, high_y = bounds(quad) + [-border, -border, border, border]
    box = max(low_x, 0), max(low_y, 0), min(high_x, image.size[0]), min(high_y, image.size[1])
    image = image.crop(box)
    quad = quad - box[:2]
    low_x, low_y, high_x, high_y = bounds(quad)
    pad = numpy.maximum(
        [
            border - low_x,
            border - low_y,
            high_x - image.size[0] + border,
            high_y - image.size[1] + border,
        ],
        0,
    )
    if pad.max() > border - 4:
        left, top, right, bottom = pad = numpy.maximum(pad, int(numpy.rint(size * 0.3)))
        values = numpy.pad(numpy.float32(image), ((top, bottom), (left, right), (0, 0)), "reflect")
        height, width, _ = values.shape
        row, column, _ = numpy.ogrid[:height, :width, :1]
        across = numpy.minimum(column / left, (width - 1 - column) / right)
        down = numpy.minimum(row / top, (height - 1 - row) / bottom)
        outside = numpy.maximum(1 - across, 1 - down)
        blurred = gaussian_filter(values, [0.02 * size, 0.02 * size, 0])
        values += (blurred - values) * numpy.clip(3 * outside + 1, 0, 1)
        values += (numpy.median(values, axis=(0, 1)) - values) * numpy.clip(outside, 0, 1)
        image = PIL.Image.fromarray(numpy.uint8(numpy.clip(numpy.rint(values), 0, 255)))
        quad = quad + [left, top]
    large = image.transform(
        (4 * side, 4 * side), PIL.Image.QUAD, (quad + 0.5).flatten(), PIL.Image.BILINEAR
    )
    return numpy.asarray(large.resize((side, side), PIL.Image.LANCZOS))


CASES = [
    {
        "height": 160,
        "width": 200,
        "center": [100.3, 70.2],
        "interocular": 24.0,
        "degrees": 0.0,
        "mouth_drop": 1.0,
        "side": 16,
    },
    {
        "height": 160,
        "width": 200,
        "center": [92.7, 75.9],
        "interocular": 21.5,
        "degrees": 17.0,
        "mouth_drop": 1.2,
        "side": 20,
    },
    {
        "height": 160,
        "width": 200,
        "center": [50.1, 110.4],
        "interocular": 30.0,
        "degrees": -12.0,
        "mouth_drop": 0.9,
        "side": 24,
    },
    {
        "height": 200,
        "width": 130,
        "center": [64.0, 60.0],
        "interocular": 40.0,
        "degrees": 5.0,
        "mouth_drop": 1.1,
        "side": 16,
    },
]

for case in CASES:
    points = landmarks_at(case["center"], case["interocular"], case["degrees"], case["mouth_drop"])
    center, x, _ = square(points)
    case["square"] = [*(center + 0.5).tolist(), *x.tolist()]
    case["pixels"] = (
        aligned(image(case["height"], case["width"]), points, case["side"]).flatten().tolist()
    )

path = pathlib.Path(__file__).with_name("alignment_vectors.json")
path.write_text("[\n" + ",\n".join(json.dumps(case) for case in CASES) + "\n]\n")
