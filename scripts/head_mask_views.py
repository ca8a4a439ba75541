#!/usr/bin/env python3
"""Asks a head-mask network for the same head several times, and keeps what it always says.

usage: head_mask_views.py write PREPARED VIEWS
       bench_head_masks VIEWS --network FILE --out VIEWS/masks
       head_mask_views.py merge PREPARED VIEWS OUT

PREPARED is a folder of stymo-prep at 256 pixels. `write` makes four other images of each photo:
smaller, turned, darker, paler. `merge` turns their masks back and writes OUT/masks, the mean of
these and of PREPARED's, and OUT/unknown, white where they differ (head_mask_labels.py --views).
"""
import os
import sys

import cv2
import numpy as np

SIDE = 256
#             scale, degrees, gamma, saturation
VARIATIONS = [(0.85, 0, 1.0, 1.0), (1.0, 0, 1.9, 1.0), (0.95, 12, 1.0, 0.6), (0.92, -10, 0.6, 1.5)]


def placement(scale, degrees):
    return cv2.getRotationMatrix2D(((SIDE - 1) / 2, (SIDE - 1) / 2), degrees, scale)


def varied(image, scale, degrees, gamma, saturation):
    moved = cv2.warpAffine(
        image, placement(scale, degrees), (SIDE, SIDE), borderMode=cv2.BORDER_REFLECT_101
    )
    light = (moved / 255.0) ** gamma
    grey = light.mean(-1, keepdims=True)
    return np.uint8(255.0 * np.clip(grey + saturation * (light - grey), 0.0, 1.0) + 0.5)


def write(prepared, views):
    os.makedirs(os.path.join(views, "images"), exist_ok=True)
    for file in sorted(os.listdir(os.path.join(prepared, "images"))):
        image = cv2.imread(os.path.join(prepared, "images", file))
        for k, variation in enumerate(VARIATIONS):
            name = f"{file[:-4]}_view{k}.png"
            cv2.imwrite(os.path.join(views, "images", name), varied(image, *variation))


def merge(prepared, views, out):
    for part in ("masks", "unknown"):
        os.makedirs(os.path.join(out, part), exist_ok=True)
    for file in sorted(os.listdir(os.path.join(prepared, "masks"))):
        masks = [cv2.imread(os.path.join(prepared, "masks", file), 0).astype(np.float32)]
        for k, (scale, degrees, _, _) in enumerate(VARIATIONS):
            mask = cv2.imread(os.path.join(views, "masks", f"{file[:-4]}_view{k}.png"), 0)
            back = cv2.invertAffineTransform(placement(scale, degrees))
            masks.append(
                cv2.warpAffine(
                    mask.astype(np.float32), back, (SIDE, SIDE), borderMode=cv2.BORDER_REPLICATE
                )
            )
        head = np.stack(masks) > 127.0
        differ = np.uint8(255 * (head.any(0) & ~head.all(0)))
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
        cv2.imwrite(os.path.join(out, "masks", file), np.uint8(np.mean(masks, 0) + 0.5))
        cv2.imwrite(os.path.join(out, "unknown", file), cv2.dilate(differ, disc))


if __name__ == "__main__":
    if sys.argv[1:2] == ["write"] and len(sys.argv) == 4:
        write(*sys.argv[2:])
    elif sys.argv[1:2] == ["merge"] and len(sys.argv) == 5:
        merge(*sys.argv[2:])
    else:
        sys.exit(__doc__)
