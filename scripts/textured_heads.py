#!/usr/bin/env python3
"""Joins the textured heads of the VALID avatars ((c) 2022 Tiffany Do, MIT) in one file.

usage: textured_heads.py FOLDER OUT.safetensors

FOLDER has NAME.npz and NAME.texK.webp: parts with vertices, triangles, uv and expression targets.
OUT is read by `stymo-synth --heads`; render/morphable/textured_heads.h says what it holds.
"""
import glob
import json
import struct
import sys

import numpy as np
from PIL import Image

SIDE = 1024
PART_SIDE = 512
TEETH_FROM = "White_M_1"
SKIN_VERTICES = 7615
# Vertices nearest to the 68 landmarks that stymo-prep finds on the mean head from the front.
LANDMARKS = [
    5608, 5507, 5447, 5182, 5142, 3338, 3311, 3350, 3186, 2808, 975, 855, 797, 805, 725, 634, 734,
    5589, 5593, 7205, 7367, 5006, 4786, 2688, 2667, 1483, 1219, 3714, 3709, 3727, 3810, 3568, 5048,
    6085, 3901, 2958, 5550, 7282, 7316, 7418, 7249, 7498, 2194, 1426, 1375, 1311, 1348, 1406, 3456,
    3418, 3141, 3112, 3057, 2942, 2349, 2334, 2332, 2330, 2368, 2788, 2430, 2750, 2511, 2740, 2553,
    2382, 2384, 2386]
# Depth and height of the line from nape to chin below which the skin is neck, in units of
# render/camera.h.
NECK_LINE = [(-0.6, -0.55), (-0.2, -0.46), (-0.05, -0.43), (0.15, -0.66), (0.35, -0.80),
             (0.7, -0.95), (0.8, -0.99)]


def load(path):
    archive = np.load(path)
    parts = []
    for part in json.loads(archive["meta"].tobytes().decode())["parts"]:
        k = part["k"]
        texture = f"{path[:-4]}.tex{part['texture']}.webp"
        parts.append({
            "name": part["name"], "texture": texture, "v": archive[f"v{k}"] / 20000.0,
            "f": archive[f"f{k}"].astype(np.int64), "uv": archive[f"uv{k}"] / 30000.0,
            "targets": {name.split(".")[-1].removesuffix("_h"):
                        archive[f"t{k}_{i}"].T * scale
                        for i, (name, scale) in enumerate(part["targets"])}})
    return parts


def image(path, side, mode):
    return np.asarray(Image.open(path).convert(mode).resize((side, side), Image.LANCZOS))


def joined(heads):
    """The vertices that all heads share (the same uv), the eyes behind them, and the targets."""
    keys = [[tuple(key) for key in np.round(head[0]["uv"] * 4000).astype(int)] for head in heads]
    shared = set.intersection(*map(set, keys))
    order = [key for key in keys[0] if key in shared]
    if len(order) != SKIN_VERTICES:
        sys.exit(f"the heads share {len(order)} vertices of skin, not {SKIN_VERTICES}")
    rows = [[{key: i for i, key in enumerate(of_head)}[key] for key in order] for of_head in keys]
    first = heads[0]
    new = np.full(len(keys[0]), -1)
    new[rows[0]] = np.arange(len(order))
    skin = new[first[0]["f"]]
    triangles, uv = [skin[(skin >= 0).all(1)]], [first[0]["uv"][rows[0]]]
    vertices = [np.stack([head[0]["v"][row] for head, row in zip(heads, rows)])]
    for k in range(1, 5):
        triangles.append(first[k]["f"] + sum(v.shape[1] for v in vertices))
        uv.append(first[k]["uv"])
        vertices.append(np.stack([head[k]["v"] for head in heads]))
    vertices = np.concatenate(vertices, 1)
    names = sorted(first[0]["targets"])
    expressions = np.zeros((len(names), vertices.shape[1], 3))
    for k, name in enumerate(names):
        expressions[k, :len(order)] = np.mean(
            [head[0]["targets"][name][row] for head, row in zip(heads, rows)], 0)
    return vertices, np.concatenate(triangles), np.concatenate(uv), names, expressions


def nearest(points, among, count):
    near = []
    for chunk in np.array_split(points, len(points) // 500 + 1):
        distance = (among ** 2).sum(1) - 2.0 * chunk @ among.T
        near.append(np.argpartition(distance, count, 1)[:, :count])
    return np.sort(np.concatenate(near), 1)


def part_tensors(out, prefix, part, owner, anchors):
    out[prefix + "vertices"] = part["v"].astype(np.float32)
    out[prefix + "triangles"] = part["f"].astype(np.int32)
    out[prefix + "uv"] = part["uv"].astype(np.float32)
    out[prefix + "texture"] = image(part["texture"], PART_SIDE, "RGBA")
    out[prefix + "anchors"] = anchors.astype(np.int32)
    out[prefix + "owner"] = np.array([owner], np.int32)


def in_frame(points, skin):
    """Points of a head in the frame of render/camera.h, from its skin."""
    eyes = skin[[LANDMARKS[k] for k in (36, 39, 42, 45)]].mean(0)
    mouth = skin[[LANDMARKS[k] for k in (48, 54)]].mean(0)
    return (points - eyes) * 0.57 / (eyes[1] - mouth[1]) + [0.0, 0.05, 0.68]


def head_share(mean):
    """1 on the head, 0 on neck and clothes, 0.5 on the line between them."""
    points = in_frame(mean, mean)
    line = np.interp(points[:, 2], *zip(*NECK_LINE))
    share = np.clip(0.5 + 4.0 * (points[:, 1] - line), 0.0, 1.0)
    share[SKIN_VERTICES:] = 1.0
    return share


def beyond(part, skin, axis, limit):
    """The part without what lies below `limit` along an axis of the frame."""
    kept = in_frame(part["v"], skin)[:, axis] > limit
    return dict(part, f=part["f"][kept[part["f"]].all(1)])


def write(path, tensors, metadata):
    types = {"float32": "F32", "int32": "I32", "uint8": "U8"}
    header, offset = {"__metadata__": metadata}, 0
    for name, tensor in tensors.items():
        header[name] = {"dtype": types[str(tensor.dtype)], "shape": list(tensor.shape),
                        "data_offsets": [offset, offset + tensor.nbytes]}
        offset += tensor.nbytes
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text)
        for tensor in tensors.values():
            file.write(np.ascontiguousarray(tensor).tobytes())


def main():
    folder, target = sys.argv[1:]
    files = sorted(glob.glob(folder + "/*.npz"))
    heads = [load(file) for file in files]
    vertices, triangles, uv, names, expressions = joined(heads)
    mean = vertices.mean(0)
    welded = np.unique(np.round(mean * 1e4), axis=0, return_index=True, return_inverse=True)
    out = {
        "vertices": vertices.astype(np.float32),
        "triangles": triangles.astype(np.int32),
        "uv": uv.astype(np.float32),
        "welded": welded[1][welded[2].reshape(-1)].astype(np.int32),
        "head": head_share(mean).astype(np.float32),
        "landmarks68": np.array(LANDMARKS, np.int32),
        "expressions": expressions.astype(np.float32),
        "textures": np.stack([image(head[0]["texture"], SIDE, "RGB") for head in heads])}
    reference = [file.endswith(f"/{TEETH_FROM}.npz") for file in files].index(True)
    for k, landmarks in enumerate(((57, 8), (33,))):
        at = mean[[LANDMARKS[i] for i in landmarks]].mean(0)[None]
        # The throat behind the teeth would show through thin necks.
        teeth = beyond(heads[reference][5 + k], vertices[reference], 2, 0.3)
        anchors = np.repeat(nearest(at, mean[:SKIN_VERTICES], 24), len(teeth["v"]), 0)
        part_tensors(out, f"teeth.{k}.", teeth, reference, anchors)
    wigs = [(owner, part) for owner, head in enumerate(heads) for part in head[7:]]
    for k, (owner, wig) in enumerate(wigs):
        anchors = nearest(wig["v"], vertices[owner, :SKIN_VERTICES], 12)
        # Hair below the shoulders is inside the clothes, and would show where these end.
        wig = beyond(wig, vertices[owner], 1, -1.35)
        part_tensors(out, f"hair.{k}.", wig, owner, anchors)
    write(target, out, {"expressions": " ".join(names),
                        "source": "VALID avatars, (c) 2022 Tiffany Do, MIT"})


if __name__ == "__main__":
    main()
