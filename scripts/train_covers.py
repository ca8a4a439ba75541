#!/usr/bin/env python3
"""Trains what tells covers of a face (configs/models/landmarks/covers.safetensors): two linear
functions of the landmark network's features, for the mouth and for the eyes.

    scripts/train_covers.py --faces FOLDER --landmarks landmarks.safetensors \\
        --out covers.safetensors

FOLDER is the output of stymo-prep at 256 pixels. On its photos fingers in the colour of the skin,
other things and sunglasses are drawn; half of the drawings on mouth or eyes, the others elsewhere,
so that a drawing alone is no cover. Photos whose head mask leaves out mouth or eyes do not count
there. Needs numpy, Pillow and PyTorch.
"""

import argparse
import json
import pathlib
import struct

import numpy
import torch
from PIL import Image, ImageDraw, ImageFilter

SIDE, MARGIN = 256, 64
ROWS, COLUMNS = numpy.mgrid[:SIDE, :SIDE].astype(numpy.float32)
LEFT_EYE, RIGHT_EYE, LIPS = slice(36, 42), slice(42, 48), slice(48, 60)


def read_tensors(path):
    data = path.read_bytes()
    length = struct.unpack("<Q", data[:8])[0]
    tensors = {}
    for name, entry in json.loads(data[8 : 8 + length]).items():
        if name != "__metadata__":
            begin, end = (8 + length + offset for offset in entry["data_offsets"])
            values = numpy.frombuffer(data[begin:end], numpy.float32)
            tensors[name] = torch.tensor(values.reshape(entry["shape"]))
    return tensors


def write_tensors(path, tensors):
    header, data = {"__metadata__": {"format": "stymo face covers 1"}}, b""
    for name, values in tensors.items():
        offsets = [len(data), len(data) + values.nbytes]
        header[name] = {"dtype": "F16", "shape": list(values.shape), "data_offsets": offsets}
        data += values.tobytes()
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(struct.pack("<Q", len(text)) + text + data)


@torch.no_grad()
def features(tensors, images):
    """What LandmarkNetwork::features gives for images (B, 80, 80, 3) in [0, 1]."""
    x = torch.as_tensor(images)
    x = x - x.mean((1, 2, 3), keepdim=True)
    x = x / torch.sqrt((x * x).mean((1, 2, 3), keepdim=True) + 1e-3)
    x = x.permute(0, 3, 1, 2)

    def layer(x, name, stride=1):
        weight, bias = (tensors[f"landmarks.{name}.{part}"] for part in ("weight", "bias"))
        x = torch.nn.functional.conv2d(x, weight.permute(0, 3, 1, 2), bias, stride, 1)
        return torch.nn.functional.leaky_relu(x, 0.1)

    for level in range(4):
        x = layer(x, f"level{level}.down", 2)
        if level > 0:
            x = x + layer(layer(x, f"level{level}.first"), f"level{level}.second")
    return x.permute(0, 2, 3, 1).flatten(1).numpy()


def in_square(image, points, scale):
    """The square of square_around (nn/pretrained/face_square.h) with 80 pixels."""
    across = points[RIGHT_EYE].mean(0) - points[LEFT_EYE].mean(0)
    across /= numpy.linalg.norm(across)
    axes = numpy.stack([across, [-across[1], across[0]]])
    at = (points - points[30]) @ axes.T
    center = points[30] + (at.min(0) + at.max(0)) / 2 @ axes + MARGIN
    half = scale * 1.25 * (at.max(0) - at.min(0)).max() / 2
    step = axes * half / 80
    corner = center - 80 * step.sum(0)
    matrix = (step[0, 0], step[1, 0], corner[0], step[0, 1], step[1, 1], corner[1])
    square = image.transform((160, 160), Image.AFFINE, matrix, Image.BILINEAR)
    return numpy.asarray(square.resize((80, 80), Image.BOX), numpy.float32) / 255


def filled(points, blur):
    mask = Image.new("L", (2 * SIDE, 2 * SIDE))
    ImageDraw.Draw(mask).polygon([tuple(2 * point) for point in points], fill=255)
    mask = mask.filter(ImageFilter.GaussianBlur(2 * blur)).resize((SIDE, SIDE), Image.BOX)
    return numpy.asarray(mask, numpy.float32)[..., None] / 255


def ellipse(width, height, power=2.0):
    angle = numpy.linspace(0, 2 * numpy.pi, 40)
    wave = numpy.stack([numpy.cos(angle), numpy.sin(angle)], 1)
    return numpy.sign(wave) * numpy.abs(wave) ** (2 / power) * [width, height]


def clouds(rng, cells, amount):
    noise = Image.fromarray(rng.normal(0, 1, (cells, cells)).astype(numpy.float32))
    return amount * numpy.asarray(noise.resize((SIDE, SIDE), Image.BICUBIC))[..., None]


def capsule(begin, end, radius):
    """Distance from a line in radii, and the place along it."""
    way = end - begin
    along = (COLUMNS - begin[0]) * way[0] + (ROWS - begin[1]) * way[1]
    along = numpy.clip(along / (way @ way), 0, 1)
    x, y = COLUMNS - begin[0] - along * way[0], ROWS - begin[1] - along * way[1]
    return numpy.hypot(x, y) / radius, along


def with_fingers(rng, photo, at, width, tone):
    angle = rng.uniform(0, 2 * numpy.pi)
    along = numpy.array([numpy.cos(angle), numpy.sin(angle)])
    across = numpy.array([-along[1], along[0]])
    radius, light = width * rng.uniform(0.09, 0.17), rng.uniform(-0.35, 0.35)
    tip, count = at + along * width * rng.uniform(0.1, 0.8), rng.integers(1, 6)
    covered = numpy.zeros((SIDE, SIDE, 1), numpy.float32)
    for finger in range(count):
        offset = (finger - (count - 1) / 2) * radius * rng.uniform(1.8, 2.2)
        r = radius * rng.uniform(0.85, 1.1)
        end = tip + across * offset + along * radius * rng.uniform(-1.2, 1.2)
        begin = end - along * width * rng.uniform(1.2, 2.5)
        begin = begin + across * offset * rng.uniform(-0.1, 0.3)
        far, place = capsule(begin, end, r)
        mask = numpy.clip((1 - far) * r + 0.5, 0, 1)[..., None]
        side = ((COLUMNS - end[0]) * across[0] + (ROWS - end[1]) * across[1]) / r
        shade = numpy.sqrt(numpy.clip(1 - 0.75 * numpy.clip(far, 0, 1) ** 2, 0.05, 1))
        color = tone * (shade * (1 + light * side.clip(-1, 1)))[..., None]
        for joint in (0.55, 0.8):
            color = color * (1 - 0.12 * numpy.exp(-(((place - joint) / 0.012) ** 2)))[..., None]
        if rng.random() < 0.5:
            nail, _ = capsule(end - along * r * 0.3, end + along * r * 0.25, r * 0.55)
            nail = numpy.clip((1 - nail) * r * 0.5 + 0.5, 0, 1)[..., None]
            color = color * (1 - nail) + nail * (color * [1.08, 1.0, 1.02] + 8).clip(0, 255)
        shadow, _ = capsule(begin + 3, end + 3, r * 1.15)
        shadow = numpy.clip((1.1 - shadow) * 3, 0, 1)[..., None]
        photo = photo * (1 - 0.35 * shadow * (1 - mask)) * (1 - mask) + color * mask
        covered = numpy.maximum(covered, mask)
    if rng.random() < 0.5:
        palm, r = tip - along * width * rng.uniform(1.3, 2.0), width * rng.uniform(0.35, 0.6)
        far, _ = capsule(palm, palm - along * width * 0.8, r)
        mask = numpy.clip((1 - far) * r + 0.5, 0, 1)[..., None]
        shade = numpy.sqrt(numpy.clip(1 - 0.5 * numpy.clip(far, 0, 1) ** 2, 0.1, 1))
        color = tone * shade[..., None]
        photo, covered = photo * (1 - mask) + color * mask, numpy.maximum(covered, mask)
    return photo * (1 + covered * (clouds(rng, 24, 0.02) + clouds(rng, 8, 0.03))), covered


def with_thing(rng, photo, points, at, width, other):
    x, y, kind = width * rng.uniform(0.3, 0.9), width * rng.uniform(0.25, 0.8), rng.integers(5)
    if kind == 4:  # a mask from cheek to cheek
        shape = numpy.concatenate([points[2:15] + rng.normal(0, 1, (13, 2)),
                                   points[28 + rng.integers(3)][None]])
    else:
        angle = numpy.sort(rng.uniform(0, 2 * numpy.pi, 9))
        shape = [
            ellipse(x, y),
            numpy.array([[-x, -y], [x, -y], [x, 2 * y], [-x, 2 * y]]),
            numpy.stack([x * numpy.cos(angle), y * numpy.sin(angle)], 1)
            * rng.uniform(0.6, 1.3, (9, 1)),
            numpy.array([[-x / 2, -y], [x / 2, -y], [0.4 * x, 3 * y], [-0.4 * x, 3 * y]]),
        ][kind]
        turn = rng.uniform(-0.6, 0.6)
        cosine, sine = numpy.cos(turn), numpy.sin(turn)
        shape = shape @ [[cosine, sine], [-sine, cosine]] + at
    mask, choice = filled(shape, rng.uniform(0.3, 1.5)), rng.random()
    if choice < 0.45:
        grey = rng.random() >= 0.6
        color = numpy.full(3, rng.uniform(10, 245)) if grey else rng.uniform(0, 255, 3)
        color = color * (1 + (clouds(rng, 6, 0.12) if rng.random() < 0.5 else 0 * mask))
    elif choice < 0.75:
        size = rng.integers(32, 128)
        left, top = rng.integers(0, SIDE - size, 2)
        part = Image.fromarray(other[top : top + size, left : left + size])
        color = numpy.asarray(part.resize((SIDE, SIDE), Image.BICUBIC), numpy.float32)
    else:
        turn, period = rng.uniform(0, numpy.pi), rng.uniform(4, 20)
        stripes = COLUMNS * numpy.cos(turn) + ROWS * numpy.sin(turn)
        stripes = numpy.sin(stripes * 2 * numpy.pi / period)[..., None] > 0
        color = numpy.where(stripes, rng.uniform(0, 255, 3), rng.uniform(0, 255, 3))
    if rng.random() < 0.6:
        grey = Image.fromarray(photo.clip(0, 255).astype(numpy.uint8)).convert("L")
        grey = numpy.asarray(grey.filter(ImageFilter.GaussianBlur(14)), numpy.float32)[..., None]
        color = color * (0.5 + 0.5 * grey / max(grey.mean(), 1))
    return photo * (1 - mask) + (color + rng.normal(0, 3, photo.shape)) * mask, mask


def with_sunglasses(rng, photo, points, width):
    eyes = [points[LEFT_EYE].mean(0), points[RIGHT_EYE].mean(0)]
    lens = ellipse(width * rng.uniform(0.3, 0.42), width * rng.uniform(0.2, 0.36),
                   rng.choice([2, 3, 5]))
    covered = [filled(lens + eye + [0, 0.05 * width], 0.5) for eye in eyes]
    bridge = numpy.array([[0, -0.03], [0, 0.03]]) * width
    bar = numpy.concatenate([eyes[0] + bridge, eyes[1] + bridge[::-1]])
    mask = numpy.maximum.reduce([*covered, filled(bar, 0.4)])
    colors = [[20, 20, 22], [60, 40, 30], [40, 70, 110], [90, 90, 90], [120, 70, 30]]
    slope = 1 + rng.uniform(-0.5, 0.5) * (ROWS - points[27][1])[..., None] / width
    tint = (numpy.array(colors[rng.integers(5)]) * slope).clip(0, 255)
    strength = mask * rng.uniform(0.8, 1)
    return photo * (1 - strength) + tint * strength, mask


def share(covered, points, growth):
    """The covered share of the hull of points, grown around their middle."""
    middle = points.mean(0)
    inside = filled(middle + (points - middle) * growth, 0)[..., 0] > 0.5
    return float(covered[..., 0][inside].mean()) if inside.any() else 0.0


def example(rng, photo, points, other):
    """A square of the photo with or without a cover, and the covered shares of mouth and eyes."""
    width = numpy.linalg.norm(points[RIGHT_EYE].mean(0) - points[LEFT_EYE].mean(0))
    width = max(width, 0.68 * numpy.linalg.norm(points[27] - points[57]))
    covered, place = numpy.zeros((SIDE, SIDE, 1), numpy.float32), rng.random()
    eye = LEFT_EYE if rng.random() < 0.5 else RIGHT_EYE
    middle, spread = (
        (points[LIPS].mean(0), 0.2) if place < 0.5
        else (points[eye].mean(0), 0.15) if place < 0.72
        else (points[rng.integers(27)], 0.3) if place < 0.85
        else (rng.uniform(10, 246, 2), 0.0)
    )  # fmt: skip
    at, kind = middle + rng.normal(0, 1, 2) * spread * width, rng.random()
    changed = photo.astype(numpy.float32)
    if rng.random() < 0.62:
        if kind < 0.6:
            places = [points[29], (points[36] + points[48]) / 2, (points[45] + points[54]) / 2,
                      (points[21] + points[22]) / 2]
            x, y = numpy.clip(places[rng.integers(4)].astype(int), 3, SIDE - 4)
            tone = numpy.median(photo[y - 3 : y + 4, x - 3 : x + 4].reshape(-1, 3), 0)
            tone = tone * rng.uniform(0.65, 1.15) * (1 + rng.normal(0, 0.04, 3))
            changed, covered = with_fingers(rng, changed, at, width, tone)
        elif kind < 0.86:
            changed, covered = with_thing(rng, changed, points, at, width, other)
        else:
            changed, covered = with_sunglasses(rng, changed, points, width)
    shares = [share(covered, points[LIPS], 1.15),
              max(share(covered, points[LEFT_EYE], 1.3), share(covered, points[RIGHT_EYE], 1.3))]
    changed = changed * rng.uniform(0.75, 1.25) * (1 + rng.normal(0, 0.06, 3)) + rng.normal(0, 6)
    changed = changed + rng.normal(0, rng.uniform(0, 4), changed.shape)
    changed = numpy.pad(changed.clip(0, 255).astype(numpy.uint8),
                        ((MARGIN, MARGIN), (MARGIN, MARGIN), (0, 0)), "edge")
    image = Image.fromarray(changed)
    if rng.random() < 0.3:
        image = image.filter(ImageFilter.GaussianBlur(rng.uniform(0.3, 1.2)))
    moved = points + rng.normal(0, 0.02 * width, 2)
    square = in_square(image, moved, rng.uniform(0.93, 1.08))
    return (square[:, ::-1].copy() if rng.random() < 0.5 else square), shares


def left_out(folder, face, points):
    """Whether the head mask leaves out the mouth, and an eye."""
    mask = numpy.asarray(Image.open(folder / "masks" / f"{face}.png").convert("L"))
    at = [points[LIPS].mean(0), points[LEFT_EYE].mean(0), points[RIGHT_EYE].mean(0)]
    grey = [mask[tuple(numpy.clip(point[::-1].astype(int), 0, SIDE - 1))] for point in at]
    return [grey[0] < 128, min(grey[1:]) < 128]


def logistic(x, labels, weights):
    """Weight and bias with the least weighted cross entropy plus 0.001 of the squared weights."""
    mean, deviation = x.mean(0), x.std(0) + 1e-3
    x = torch.tensor((x - mean) / deviation)
    weight = torch.zeros(x.shape[1], 2, requires_grad=True)
    bias = torch.zeros(2, requires_grad=True)
    optimizer = torch.optim.LBFGS([weight, bias], max_iter=60, line_search_fn="strong_wolfe")

    def loss():
        optimizer.zero_grad()
        each = torch.nn.functional.binary_cross_entropy_with_logits(
            x @ weight + bias, labels, reduction="none")
        total = (each * weights).sum() / weights.sum() + 1e-3 * (weight * weight).sum()
        total.backward()
        return total

    optimizer.step(loss)
    scaled = weight.detach().numpy().T / deviation
    return scaled, bias.detach().numpy() - scaled @ mean


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--faces", type=pathlib.Path, required=True)
    parser.add_argument("--landmarks", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--examples", type=int, default=12000)
    parser.add_argument("--prefix", default="", help="ids that count, the others are held out")
    options = parser.parse_args()
    rng, tensors = numpy.random.default_rng(1), read_tensors(options.landmarks)
    lines = map(json.loads, (options.faces / "faces.jsonl").read_text().splitlines())
    faces = [(line["id"], numpy.array(line["landmarks"], float)) for line in lines
             if line["id"].startswith(options.prefix)]  # fmt: skip

    def photo(face):
        path = options.faces / "images" / f"{face}.png"
        return numpy.asarray(Image.open(path).convert("RGB"))

    inputs, shares, counts, batch = [], [], [], []
    for face, points in (faces[i] for i in rng.integers(len(faces), size=options.examples)):
        other = photo(faces[rng.integers(len(faces))][0])
        square, covered = example(rng, photo(face), points, other)
        batch.append(square)
        shares.append(covered)
        counts.append([not out for out in left_out(options.faces, face, points)])
        if len(batch) == 64 or len(shares) == options.examples:
            inputs.append(features(tensors, numpy.stack(batch)))
            batch = []
    shares = torch.tensor(shares)
    labels = shares > torch.tensor([0.35, 0.5])
    clear = (labels | (shares < 0.03)) & torch.tensor(counts)
    weight, bias = logistic(numpy.concatenate(inputs), labels.float(), clear.float())
    write_tensors(options.out, {"covers.weight": weight.astype(numpy.float16),
                                "covers.bias": bias.astype(numpy.float16)})  # fmt: skip


if __name__ == "__main__":
    main()
