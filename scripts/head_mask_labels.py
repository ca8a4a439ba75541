#!/usr/bin/env python3
"""Makes the labels from which the head-mask network is trained.

usage: head_mask_labels.py PREPARED OUT [--wall PREFIX]... [--drop FILE] [--short-hair FILE]
                           [--mended FILE] [--views FOLDER]

PREPARED is a folder of stymo-prep at 256 pixels: images, masks, landmarks in faces.jsonl. OUT gets
images, masks, unknown, persons and backgrounds, as train/head_mask_examples.h reads them.
Ids that begin with a --wall prefix stand before a plain wall: the outline and the person come from
the distance to the wall's colour. Photos in --drop (one id a line) only give their background.
Those in --short-hair have no hair below the jaw, only a suit of its colour. --mended has
outlines of heads by hand, {"ID": [[x, y], ...]} in pixels. With --views, the masks are those of a
network that learnt from earlier labels: as they are before a wall, elsewhere known where it says
the same of several views (head_mask_views.py).
"""
import argparse
import json
import os

import cv2
import numpy as np

SIDE = 256
ROWS, COLUMNS = np.mgrid[0:SIDE, 0:SIDE] / SIDE


def ellipse(radius):
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))


def wall_matte(image, mask):
    """Probability of the person: the distance from a wall whose colour is a quadratic in x, y."""
    terms = np.stack([np.ones_like(ROWS), ROWS, COLUMNS, ROWS**2, COLUMNS**2, ROWS * COLUMNS], -1)
    pixels = cv2.GaussianBlur(image, (3, 3), 0).astype(np.float32)
    outside = cv2.dilate(mask, ellipse(9)) < 128
    sure = outside & (ROWS < 0.55)
    for _ in range(8):
        if sure.sum() < 400:
            return None
        weights = np.linalg.lstsq(terms[sure], pixels[sure], rcond=None)[0]
        distance = np.linalg.norm(pixels - terms @ weights, axis=-1)
        noise = max(3.0, np.median(distance[sure]) * 1.5)
        sure = outside & (distance < 3.0 * noise)
    alpha = np.clip((distance - 2.5 * noise) / (5.0 * noise), 0.0, 1.0)
    # What the wall surrounds is the person; what is not connected to the border is not the wall.
    _, labels = cv2.connectedComponents((alpha < 0.5).astype(np.uint8), connectivity=4)
    upper = labels[: SIDE * 3 // 4]
    border = np.unique(np.concatenate([labels[0], upper[:, 0], upper[:, -1]]))
    wall = np.isin(labels, border[border > 0])
    inside = cv2.erode((~wall).astype(np.uint8), ellipse(2)) > 0
    near_wall = cv2.dilate(wall.astype(np.uint8), ellipse(3)) > 0
    alpha = np.where(near_wall & ~inside, alpha, 1.0)
    # Not a plain wall if parts of the head or most of the frame's upper corners look otherwise.
    head = cv2.erode(mask, ellipse(3)) > 127
    corners = outside & (ROWS < 0.3)
    plain = alpha[head].mean() > 0.97 and (corners.sum() < 50 or alpha[corners].mean() < 0.08)
    return alpha if plain else None


def skin_and_hair(image, mask, points):
    """Squared distances of each pixel from the colours of the cheeks and of the hair."""
    lab = cv2.cvtColor(image, cv2.COLOR_BGR2LAB).astype(np.float32)
    lab[..., 0] *= 0.4  # the neck lies in the shadow
    cheeks = np.zeros_like(mask)
    cv2.fillPoly(cheeks, [np.int32(np.concatenate([points[2:15], points[[35, 30, 31]]]))], 255)
    height = points[8, 1] - points[27, 1]
    above = (mask > 127) & (ROWS * SIDE < points[17:27, 1].min() - 0.25 * height)
    distances = []
    for region in (cheeks > 0, above):
        if region.sum() < 60:
            distances.append(np.full(mask.shape, 1e3, np.float32))
            continue
        values = lab[region]
        center = np.median(values, axis=0)
        spread = np.median(np.abs(values - center), axis=0) * 1.5 + 3.0
        distances.append((((lab - center) / spread) ** 2).sum(-1))
    return distances


def below_jaw(points):
    """Mask of what lies under the line of the jaw, continued to both sides from below the ears."""
    left, right = points[2], points[14]
    ends = [[SIDE, right[1]], [SIDE, SIDE], [0, SIDE]]
    line = np.concatenate([[[0, left[1]]], points[2:15], ends])
    zone = np.zeros((SIDE, SIDE), np.uint8)
    cv2.fillPoly(zone, [np.int32(np.round(line))], 255)
    return zone > 0


def softened(mask):
    return cv2.GaussianBlur(mask, (3, 3), 0).astype(np.float32) / 255.0


def outlined(head, mask, person):
    """A head mask whose outline beside the wall is that of the person."""
    if person is None:
        return head
    grown = cv2.dilate(mask, ellipse(4)) > 127
    by_wall = cv2.dilate((person < 0.5).astype(np.uint8), ellipse(6)) > 0
    return np.where(by_wall, person * grown, head)


def label(image, mask, points, person, short_hair=False):
    """Head mask and unknown pixels, both in [0, 1]."""
    head = outlined(softened(mask), mask, person)
    unknown = np.zeros((SIDE, SIDE), np.float32)
    skin, hair = skin_and_hair(image, mask, points)
    under = below_jaw(points)
    depth = cv2.distanceTransform(under.astype(np.uint8), cv2.DIST_L2, 3)
    neck = under & (head > 0.5) & (depth > 2)
    sure = neck & (skin < 12.0) & (skin < 0.5 * hair) | (neck & (depth > 6) & short_hair)
    head[sure] = 0.0
    unknown[neck & ~sure & ((skin < hair) | (hair > 12.0))] = 1.0
    return head, cv2.dilate(unknown, ellipse(1)) * (cv2.dilate(neck.astype(np.uint8), ellipse(2)))


def outline_label(points):
    """Head mask and unknown pixels for an outline by hand, which is right to a few pixels."""
    head = np.zeros((SIDE, SIDE), np.uint8)
    cv2.fillPoly(head, [np.int32(points)], 1)
    sure = cv2.erode(head, ellipse(6)), 1 - cv2.dilate(head, ellipse(6))
    return head.astype(np.float32), 1.0 - np.float32(sure[0] | sure[1])


def enclosed(head, unknown, radius=3):
    """Gives unknown parts that head alone, or what is not head alone, surrounds to that."""
    parts = cv2.morphologyEx(unknown.astype(np.uint8), cv2.MORPH_OPEN, ellipse(radius))
    count, labels = cv2.connectedComponents(parts)
    for part in range(1, count):
        inside = cv2.dilate((labels == part).astype(np.uint8), ellipse(2)) * unknown > 0
        around = (cv2.dilate(inside.astype(np.uint8), ellipse(4)) > 0) & ~inside
        known = around & (unknown == 0)
        share = head[known].mean() > 0.97, (1.0 - head[known]).mean() > 0.97
        if known.sum() >= 0.5 * around.sum() and any(share):
            head[inside] = float(share[0])
            unknown[inside] = 0.0
    return head, unknown


def views_label(folder, name):
    """Head mask and unknown pixels by several views; None if too much is unknown."""
    head, unknown = (
        cv2.imread(os.path.join(folder, part, name + ".png"), 0).astype(np.float32) / 255.0
        for part in ("masks", "unknown")
    )
    head, unknown = enclosed(head, unknown)
    return (head, unknown) if unknown.sum() <= 0.35 * (head > 0.5).sum() else None


def without_head(image, mask):
    """The photo with its head painted over by what is beside it."""
    gone = cv2.dilate(mask, ellipse(10)) > 127
    rolled = np.roll(image, SIDE // 2, axis=1)
    filled = np.where(gone[..., None], rolled, image)
    still = gone & np.roll(gone, SIDE // 2, axis=1)
    return cv2.inpaint(filled, still.astype(np.uint8), 5, cv2.INPAINT_TELEA)


def drawn_background(rng):
    """Gradients, stripes and patches: walls, flags and rooms without a photo."""
    picture = np.zeros((SIDE, SIDE, 3), np.float32)
    low, high, angle = rng.uniform(0, 255, 3), rng.uniform(0, 255, 3), rng.uniform(0, 6.28)
    along = np.cos(angle) * COLUMNS + np.sin(angle) * ROWS
    picture += low + (high - low) * along[..., None]
    for _ in range(rng.integers(0, 14)):
        color = tuple(float(c) for c in rng.uniform(0, 255, 3))
        if rng.random() < 0.3:
            period, turn = rng.uniform(6, 60), rng.uniform(0, 6.28)
            wave = np.sin((np.cos(turn) * COLUMNS + np.sin(turn) * ROWS) * SIDE * 6.28 / period)
            first, last = rng.uniform(-0.3, 0.8), rng.uniform(0.2, 1.3)
            picture[(wave > 0) & (COLUMNS > first) & (COLUMNS < last)] = color
        else:
            corners = rng.uniform(-40, SIDE + 40, (rng.integers(3, 6), 2))
            cv2.fillPoly(picture, [np.int32(corners)], color)
    picture = cv2.GaussianBlur(picture, (0, 0), rng.uniform(0.5, 5.0))
    picture += rng.normal(0, rng.uniform(0, 8), picture.shape)
    return np.clip(picture, 0, 255).astype(np.uint8)


def extra_copies(name, head, points, mended):
    """How often more a photo counts: hats and long hair are rare among official portraits."""
    if name in mended:
        return 2
    below_chin = head[min(SIDE - 1, int(points[8, 1]) + 2) :].sum() / SIDE**2
    return 3 if below_chin > 0.01 and not name.startswith("a_london") else 0


def write(folder, name, picture):
    os.makedirs(folder, exist_ok=True)
    if picture.dtype != np.uint8:
        picture = np.clip(np.round(255.0 * picture), 0, 255).astype(np.uint8)
    cv2.imwrite(os.path.join(folder, name + ".png"), picture, [cv2.IMWRITE_PNG_COMPRESSION, 1])


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("prepared")
    parser.add_argument("out")
    parser.add_argument("--wall", action="append", default=[])
    parser.add_argument("--drop")
    parser.add_argument("--short-hair")
    parser.add_argument("--mended")
    parser.add_argument("--views")
    parser.add_argument("--only", default="a_", help="ids that begin with this")
    parser.add_argument("--drawn", type=int, default=300)
    options = parser.parse_args()
    dropped = set(open(options.drop).read().split()) if options.drop else set()
    short = set(open(options.short_hair).read().split()) if options.short_hair else set()
    mended = json.load(open(options.mended)) if options.mended else {}
    for line in open(os.path.join(options.prepared, "faces.jsonl")):
        record = json.loads(line)
        name = record["id"]
        if not name.startswith(options.only):
            continue
        image = cv2.imread(os.path.join(options.prepared, "images", name + ".png"))
        mask = cv2.imread(os.path.join(options.prepared, "masks", name + ".png"), 0)
        on_wall = any(name.startswith(prefix) for prefix in options.wall)
        person = wall_matte(image, mask) if on_wall else None
        if not on_wall:
            write(os.path.join(options.out, "backgrounds"), name, without_head(image, mask))
        if name in dropped:
            continue
        points = np.float32(record["landmarks"])
        head, unknown = label(image, mask, points, person, name in short)
        if name in mended:
            head, unknown = outline_label(mended[name])
        elif options.views and person is not None:
            head, unknown = outlined(softened(mask), mask, person), np.zeros((SIDE, SIDE))
        elif options.views:
            both = views_label(options.views, name)
            if both is None:
                continue
            head, unknown = both
        parts = {"images": image, "masks": head, "unknown": unknown, "persons": person}
        for k in range(1 + extra_copies(name, head, points, mended)):
            for part, picture in parts.items():
                if picture is not None and (part != "unknown" or picture.any()):
                    write(os.path.join(options.out, part), f"{name}_{k}" if k else name, picture)
    rng = np.random.default_rng(1)
    for k in range(options.drawn):
        write(os.path.join(options.out, "backgrounds"), f"drawn_{k:04d}", drawn_background(rng))


if __name__ == "__main__":
    main()
