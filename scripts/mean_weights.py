#!/usr/bin/env python3
"""Averages the weights of networks of equal shape, as for configs/models/head-mask.

usage: mean_weights.py OUT.safetensors FILE.safetensors:SHARE...

The shares add up to 1. OUT has the metadata of the first file.
"""
import json
import struct
import sys

import numpy as np

TYPES = {"F16": np.float16, "F32": np.float32, "F64": np.float64}


def read(path):
    """The header with its length, its JSON, and the tensors by name."""
    with open(path, "rb") as file:
        content = file.read()
    end = 8 + struct.unpack("<Q", content[:8])[0]
    header = json.loads(content[8:end])
    tensors = {}
    for name, entry in header.items():
        if name != "__metadata__":
            first, last = entry["data_offsets"]
            numbers = np.frombuffer(content[end + first : end + last], TYPES[entry["dtype"]])
            tensors[name] = numbers.astype(np.float64)
    return content[:end], header, tensors


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    files = [argument.rsplit(":", 1) for argument in sys.argv[2:]]
    begin, header, mean = read(files[0][0])
    mean = {name: float(files[0][1]) * numbers for name, numbers in mean.items()}
    for path, share in files[1:]:
        tensors = read(path)[2]
        if tensors.keys() != mean.keys():
            sys.exit(f"{path}: another network than {files[0][0]}")
        for name, numbers in tensors.items():
            mean[name] = mean[name] + float(share) * numbers
    with open(sys.argv[1], "wb") as out:
        out.write(begin)
        for name in sorted(mean, key=lambda name: header[name]["data_offsets"][0]):
            out.write(mean[name].astype(TYPES[header[name]["dtype"]]).tobytes())


if __name__ == "__main__":
    main()
