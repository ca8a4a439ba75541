"""Writes a folder of real files for each reader: make_seeds.py FOLDER. Fuzzing begins with them."""

import json
import pathlib
import struct
import sys

golden = pathlib.Path(__file__).resolve().parent.parent / "golden"
configurations = golden.parent.parent / "configs"
sizes = {"id": 100, "expr": 79, "tex": 100, "light": 27}
pose = {"yaw_deg": 12.5, "pitch_deg": -3.0, "roll_deg": 1e-3, "t": [0.1, -0.2, 5.3]}
code = {group: [0.01 * i for i in range(size)] for group, size in sizes.items()}
landmarks = [[0.01 * i, 0.5] for i in range(68)]
label = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 2.7, 0, 0, 0, 1, 4.26, 0, 0.5, 0, 4.26, 0.5, 0, 0, 1]


def safetensors(tensors, metadata=None):
    """Tensors of 32-bit floats: name -> (shape, values)."""
    header, data = {}, b""
    if metadata:
        header["__metadata__"] = metadata
    for name, (shape, values) in tensors.items():
        begin = len(data)
        data += struct.pack(f"<{len(values)}f", *values)
        header[name] = {"dtype": "F32", "shape": shape, "data_offsets": [begin, len(data)]}
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + data


def mesh(shift):
    lines = ["mtllib a.mtl"]
    for k in range(70):
        lines.append(f"v {k % 7 - 3 + shift} {-4 if 48 <= k < 68 else 3} 8")
    return "\n".join(lines + ["vt 0.5 0.5", "f 1/1 2/1 37/1 4/1", "f -1/1/1 -2//1 3"]) + "\n"


def head():
    points = [x for k in range(70) for x in (k % 7 - 3, -4 if 48 <= k < 68 else 3, 8)]
    return {
        "mean": ([70, 3], points),
        "basis.id": ([100, 70, 3], [0.5] * (100 * 70 * 3)),
        "basis.expr": ([1, 70, 3], [1.0] * (70 * 3)),
        "triangles": ([1, 3], [0, 1, 36]),
        "landmarks68": ([68], list(range(68))),
    }


def request(**more):
    return json.dumps({"face": "f1", "sliders": {"id": [1, -2]}, **more})


camera = {"yaw": 10, "pitch": -5, "roll": 2, "distance": 1.2}
face = {"id": "00000", "pose": pose, "code": code, "landmarks": landmarks}
outcome = {
    "file": "00000.png",
    "failure": "",
    "faces": [
        {
            "face": face,
            "landmark_error": 0.01,
            "was_aligned": True,
            "made_mask": False,
            "warnings": ["dark"],
            "mask_agreement": 0.9,
            "network_rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1],
        }
    ],
}
metrics = {"l1": 0.1, "l1_mean": 0.1, "ssim": 0.9, "psnr": 20.0, "lpips": 0.2}
score = {
    "id": "00000",
    "head": {"initial": metrics, "fitted": metrics},
    "counting_samples": 0.5,
    "identity": {"photo": 0.7, "turned_15": 0.6, "turned_30": 0.5, "other": 0.1},
}
faces = "\n".join(json.dumps({**face, "id": f"{i:05}"}) for i in range(2)) + "\n"
small = {"a": ([2, 2], [1, 2, 3, 4]), "b": ([0], [])}
seeds = {
    "face_index": ["0 0 cl p 0.1 -0.2 0.3 0 0 5.3 00000\n0 0 - - a b\n"],
    "safetensors": [safetensors(small, {"format": "x"}), safetensors({})]
    + [file.read_bytes() for file in golden.glob("safetensors/*.safetensors")],
    "torch": [file.read_bytes() for file in golden.glob("weights/*.p*")],
    "onnx": [file.read_bytes() for file in golden.glob("weights/*.onnx")],
    "config": [file.read_bytes() for file in configurations.glob("*.json")]
    + [b"stage1.steps=3", b'output.x="a"'],
    "faces": [faces, '{"id":"a"}\n\n{"id":"b"}'],
    "intrinsics": ['{"focal": 3.2, "cx": 0.5, "cy": 0.5}'],
    "photo_ids": ['{"photos": ["00000", "00001"], "found": 2}'],
    "codes": [json.dumps({"code": code, "pose": pose}), json.dumps({"pose": pose})],
    "camera": [
        json.dumps({"pose": pose}),
        json.dumps({"labels": [["00000", label], ["00001", label]]}),
        json.dumps(label),
        "1 0 0 0  0 1 0 0  0 0 1 5  0 0 0 1",
        "1,0,0,0, 0,1,0,0, 0,0,1,5",
        '{"id": "00000", "pose": %s}\n{"id": "00001", "pose": %s}\n'
        % (json.dumps(pose), json.dumps(pose)),
    ],
    "head": [safetensors(head())],
    "obj": [mesh(0), mesh(1)],
    "obj_indices": [
        json.dumps({"expressions": ["jawOpen"], "idx_to_landmark_verts": list(range(68))})
    ],
    "request": [
        request(camera=camera, layer="mask", quality="still"),
        request(camera={"eye": [0.1, 0, 0.6], "screen": 0.3}),
        request(x=0.5, y=0.4, color=[1, 0, 0.5]),
        request(keys=[camera, camera], seconds=2, fps=12, format="mp4"),
        request(source="f2", groups=["id", "tex"]),
        '{"seed": 3, "truncation": 0.7, "name": "new"}',
        '{"codes": "00ff"}',
        '{"file": "{}"}',
        "0.5",
    ],
    "tuned": [
        safetensors(
            {"decoder.field.density.weight": ([1, 8], [0] * 8)},
            {"format": "stymo-weight-changes-1", "model": "0"},
        )
    ],
    "progress": [json.dumps(outcome), '{"file": "a", "failure": "no face", "faces": []}'],
    "scores": [json.dumps(score)],
    "marks": [
        json.dumps({"photos": [{"file": "a.jpg", "points": {"36": [10, 20.5], "45": [60, 20]}}]})
    ],
}
for reader, files in seeds.items():
    folder = pathlib.Path(sys.argv[1]) / reader
    folder.mkdir(parents=True, exist_ok=True)
    for number, contents in enumerate(files):
        data = contents if isinstance(contents, bytes) else contents.encode()
        (folder / f"seed_{number}").write_bytes(data)
