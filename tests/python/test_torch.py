"""The decoder of the model that ships against the one in plain PyTorch (tests/golden)."""
import json
import os
import pathlib
import sys
import unittest

import numpy as np

import stymo

SOURCE = pathlib.Path(os.environ["STYMO_SOURCE_DIR"])
SHIPPED = SOURCE / "configs/models/faces-256/model.safetensors"
TYPES = {"F16": np.float16, "F32": np.float32}


def tensors_of(path):
    """The configuration and the tensors, in float64, of a model's file."""
    content = path.read_bytes()
    end = 8 + int.from_bytes(content[:8], "little")
    header = json.loads(content[8:end])
    config = json.loads(header.pop("__metadata__")["config"])
    tensors = {}
    for name, entry in header.items():
        if entry["dtype"] in TYPES:
            begin, stop = (end + offset for offset in entry["data_offsets"])
            values = np.frombuffer(content[begin:stop], TYPES[entry["dtype"]])
            tensors[name] = values.reshape(entry["shape"]).astype(np.float64)
    return config, tensors


class AgainstTorch(unittest.TestCase):
    def test_the_shipped_decoder_and_its_gradient(self):
        try:
            import torch
        except ImportError:
            self.skipTest("PyTorch is not installed")
        sys.path.insert(0, str(SOURCE / "tests/golden"))
        from torch_model import CODES, Decoder, DecoderSize, sample_rays

        config, tensors = tensors_of(SHIPPED)
        sizes, camera, samples = config["decoder"], config["camera"], 16
        decoder = Decoder(
            lambda name, *shape, **unused: torch.from_numpy(tensors[name]).reshape(shape),
            "decoder", DecoderSize(**{key: sizes[key] for key in (
                "resolution", "field_width", "field_layers", "feature_channels", "frequencies",
                "block_channels", "mask_channels", "mapping_layers")}))
        # Seen from the front, depths along the optical axis are those between planes of z.
        rays = sample_rays(torch.tensor([[0, 0, 0, 0, 0, camera["distance"]]], dtype=torch.float64),
                           32, samples, None, camera["focal"], sizes["near_z"], sizes["far_z"])

        model = stymo.Model.load(str(SHIPPED))
        start = model.sample(seed=4)[0].codes[None]
        codes = torch.tensor(start, dtype=torch.float64, requires_grad=True)
        image = decoder(dict(zip(CODES, codes.split(list(CODES.values()), 1))), rays)["images"][-1]
        image.square().mean().backward()

        own_codes = stymo.Tensor(start, requires_grad=True)
        own = model.decode(own_codes, None, 256, samples)
        own.square().mean().backward()
        expected = image.detach().permute(0, 2, 3, 1).numpy()
        self.assertLess(np.abs(own.numpy() - expected).max(), 1e-3)
        wanted = codes.grad.numpy()
        self.assertLess(np.linalg.norm(own_codes.grad - wanted), 1e-3 * np.linalg.norm(wanted))


if __name__ == "__main__":
    unittest.main()
