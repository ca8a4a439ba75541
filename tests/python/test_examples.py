"""The examples of docs/examples that are written in Python."""
import json
import os
import pathlib
import sys
import unittest

import numpy as np

import stymo

EXAMPLES = pathlib.Path(os.environ["STYMO_SOURCE_DIR"]) / "docs/examples"


class Examples(unittest.TestCase):
    def test_the_notebook_runs(self):
        names = {}
        for cell in json.loads((EXAMPLES / "faces.ipynb").read_text())["cells"]:
            if cell["cell_type"] == "code":
                exec("".join(cell["source"]), names)
        self.assertEqual(names["row"].shape, (256, 5 * 256, 3))

    def test_pytorch_gets_the_gradient_of_the_engine(self):
        try:
            import torch
        except ImportError:
            self.skipTest("PyTorch is not installed")
        sys.path.insert(0, str(EXAMPLES))
        from torch_decoder import Decode

        model = stymo.Model.load()
        start = np.stack([face.codes for face in model.sample(2)])
        codes = torch.tensor(start, requires_grad=True)
        image = Decode.apply(codes, model, None, 64)
        (image.square().mean() + codes.square().mean()).backward()

        x = stymo.Tensor(start, requires_grad=True)
        own = model.decode(x, None, 64)
        np.testing.assert_array_equal(image.detach().numpy(), own.numpy())
        (own.square().mean() + x.square().mean()).backward()
        np.testing.assert_allclose(codes.grad.numpy(), x.grad, rtol=1e-4, atol=1e-8)


if __name__ == "__main__":
    unittest.main()
