"""The Python package: results against the tools' own formats and NumPy, misuse, and memory."""
import gc
import json
import os
import pathlib
import sys
import tempfile
import threading
import time
import unittest

import numpy as np

import stymo

ROOT = pathlib.Path(os.environ["STYMO_SOURCE_DIR"])
model = stymo.Model.load()


class Faces(unittest.TestCase):
    def test_codes_and_images_are_read_only_views(self):
        face = model.sample(seed=3)[0]
        self.assertEqual((face.codes.shape, face.codes.dtype), ((306,), np.float32))
        image = model.render(face, yaw=20, size=64)
        self.assertEqual((image.shape, image.dtype), ((64, 64, 3), np.float32))
        self.assertFalse(image.flags.writeable or image.flags.owndata)
        self.assertTrue(0 <= image.min() < image.max() <= 1)
        kept = image.copy()
        model.render(model.sample(seed=4)[0], size=64)
        gc.collect()
        np.testing.assert_array_equal(image, kept)  # the next view has memory of its own

    def test_heads_fade_to_black_by_their_opacity_unless_raw(self):
        face = model.sample(seed=3)[0]
        raw = model.render(face, size=64, raw=True)
        cutout = model.render(face, size=64, cutout=True)
        self.assertEqual(cutout.shape, (64, 64, 4))
        np.testing.assert_array_equal(cutout[..., :3], raw)
        np.testing.assert_allclose(model.render(face, size=64), raw * cutout[..., 3:], atol=1e-6)

    def test_codes_render_as_their_face_does(self):
        face = model.sample(seed=3)[0]
        np.testing.assert_array_equal(model.render(face.codes, size=64),
                                      model.render(face, size=64))

    def test_mixing_takes_the_groups_that_are_named(self):
        a, b = model.sample(2, seed=1)
        mixed = model.mix(a, b, "expr,light").codes
        for name, part in stymo.GROUPS.items():
            source = b if name in ("expr", "light") else a
            np.testing.assert_array_equal(mixed[part], source.codes[part])

    def test_files_are_those_of_the_tools(self):
        face = model.sample(seed=3)[0]
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "codes.json"
            face.write(file)
            read = model.read(file)
            content = json.loads(file.read_text())
        np.testing.assert_array_equal(read.codes, face.codes)
        np.testing.assert_array_equal(np.float32(content["code"]["tex"]),
                                      face.codes[stymo.GROUPS["tex"]])
        self.assertAlmostEqual(content["pose"]["yaw_deg"], face.pose["yaw"])
        self.assertEqual(content["pose"]["t"], list(face.pose["position"]))

    def test_a_drawn_face_is_fitted_and_tuned(self):
        drawn = model.render(model.sample(seed=5)[0])
        stages = []
        face = model.fit(drawn, steps=6, progress=lambda stage, step, loss: stages.append(stage))
        self.assertEqual(stages, ["fit"] * 6)
        self.assertGreater(face.psnr, 20)
        as_bytes = model.fit(np.uint8(np.round(drawn * 255)), steps=6)
        self.assertLess(np.abs(as_bytes.codes - face.codes).max(), 0.2)
        tuned = model.tune(face, seconds=0, steps=2)
        self.assertTrue(tuned.tuned and not face.tuned)

    def test_a_mesh_has_arrays_in_metres(self):
        face = model.sample(seed=3)[0]
        mesh = model.mesh(face, texture=64)
        count = len(mesh.vertices)
        self.assertEqual((mesh.vertices.shape, mesh.normals.shape, mesh.uv.shape,
                          mesh.texture.shape), ((count, 3), (count, 3), (count, 2), (64, 64, 3)))
        self.assertEqual((mesh.faces.dtype, mesh.faces.shape[1]), (np.int32, 3))
        self.assertTrue(0 <= mesh.faces.min() and mesh.faces.max() < count)
        self.assertTrue(0.15 < np.ptp(mesh.vertices[:, 1]) < 0.3)
        # Triangles turn their outside to where the normals point.
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), mesh.normals[mesh.faces[:, 0]])
        self.assertGreater((outward > 0).mean(), 0.95)
        self.assertLess(mesh.shapes["jawOpen"][:, 1].min(), -0.005)
        self.assertNotIn("tongueOut", mesh.shapes)
        rest = model.mesh(face.codes, texture=64, neutral=True)
        np.testing.assert_array_equal(rest.texture, mesh.texture)
        moved = np.linalg.norm(rest.vertices - mesh.vertices, axis=1).max()
        self.assertTrue(0.0005 < moved < 0.03, moved)
        faces = mesh.faces
        del mesh
        gc.collect()
        self.assertEqual(faces.max() + 1, count)  # the array keeps its mesh

    def test_an_exception_of_the_progress_ends_the_fit(self):
        def stop(*_):
            raise KeyError("enough")
        drawn = model.render(model.sample(seed=5)[0])
        with self.assertRaisesRegex(KeyError, "enough"):
            model.fit(drawn, steps=3, progress=stop)

    def test_other_threads_run_while_a_view_is_rendered(self):
        face, turns = model.sample(seed=3)[0], 0
        interval = sys.getswitchinterval()
        sys.setswitchinterval(100)  # another thread runs only if the lock is given away
        try:
            thread = threading.Thread(target=lambda: model.render(face))
            thread.start()
            while thread.is_alive():
                time.sleep(0.001)
                turns += 1
        finally:
            sys.setswitchinterval(interval)
        self.assertGreater(turns, 10)


class Misuse(unittest.TestCase):
    def fails(self, kind, message, call):
        with self.assertRaises(kind) as caught:
            call()
        self.assertIn(message, str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))

    def test_one_line_says_what_is_wrong(self):
        face = model.sample()[0]
        photo = np.zeros((8, 8, 3), np.float32)
        for kind, message, call in [
            (OSError, "no.safetensors: cannot be read (No such file or directory)",
             lambda: stymo.Model.load("no.safetensors")),
            (ValueError, "image: the shape is (8, 8); give (height, width, 3)",
             lambda: model.fit(photo[:, :, 0].copy())),
            (ValueError, "image: not contiguous; give numpy.ascontiguousarray(...)",
             lambda: model.fit(photo[:, ::2])),
            (ValueError, "image: not contiguous", lambda: model.fit(photo[::-1])),
            (TypeError, "image: elements of type int64; give uint8, float32 or float64",
             lambda: model.fit(photo.astype(np.int64))),
            (ValueError, "image: floats must be in [0, 1]", lambda: model.fit(photo + 2)),
            (ValueError, "image: floats must be in [0, 1]", lambda: model.fit(photo + np.nan)),
            (TypeError, "image: a str is no array of numbers", lambda: model.fit("me.jpg")),
            (TypeError, "image: a list is no array of numbers", lambda: model.fit([[[1, 2, 3]]])),
            (OSError, "the photo: no face was found", lambda: model.fit(photo)),
            (ValueError, "steps and tune must not be negative",
             lambda: model.fit(photo, steps=-1)),
            (ValueError, 'optimizer: "sgd" is none', lambda: model.fit(photo, optimizer="sgd")),
            (ValueError, "codes: the shape is (305); give (306)",
             lambda: model.render(np.zeros(305, np.float32))),
            (ValueError, 'mode: "fast" is no mode', lambda: model.render(face, mode="fast")),
            (ValueError, "an angle is nan degrees", lambda: model.render(face, yaw=np.nan)),
            (ValueError, "a side of 64, 128, 256, not 100", lambda: model.render(face, size=100)),
            (ValueError, '"nose" is no group of codes', lambda: model.mix(face, face, "nose")),
            (ValueError, "a texture has a side of 64, 128, 256 ... 8192 pixels, not 100",
             lambda: model.mesh(face, texture=100)),
            (ValueError, "only a face that was fitted", lambda: model.tune(face, 1)),
            (ValueError, "the face is not tuned", lambda: face.write("a.json", "t.safetensors")),
            (ValueError, "-1 threads; give 0", lambda: stymo.set_threads(-1)),
            (ValueError, "1000000 threads; give 0", lambda: stymo.set_threads(10**6)),
            (ValueError, "the truncation of a new face must be from 0 to 10",
             lambda: model.sample(truncation=np.nan)),
            (ValueError, "is too large",
             lambda: stymo.Tensor(np.zeros(0, np.float32)).reshape([2**32, 2**32])),
        ]:
            with self.subTest(message):
                self.fails(kind, message, call)


class Engine(unittest.TestCase):
    def test_threads_may_go_backward_through_the_same_leaf(self):
        leaf = stymo.Tensor(np.ones(10_000, np.float32), requires_grad=True)
        losses = [(leaf * float(factor)).sum() for factor in range(1, 33)]
        threads = [threading.Thread(target=loss.backward) for loss in losses]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        np.testing.assert_array_equal(leaf.grad, np.full(10_000, 528.0))

    def test_tensors_share_memory_in_both_directions(self):
        array = np.arange(6, dtype=np.float64).reshape(2, 3)
        tensor = stymo.Tensor(array)
        self.assertTrue(np.shares_memory(tensor.numpy(), array))
        self.assertEqual(np.from_dlpack(tensor).ctypes.data, array.ctypes.data)
        count = sys.getrefcount(array)
        del tensor
        gc.collect()
        self.assertLess(sys.getrefcount(array), count)

    def test_gradients_are_those_of_calculus(self):
        rng = np.random.default_rng(0)
        a, b = rng.normal(size=(3, 4)), rng.normal(size=(4, 2))
        x, w = stymo.Tensor(a, requires_grad=True), stymo.Tensor(b, requires_grad=True)
        y = ((x @ w).sin() * 2.0 - 1.0).square().sum()
        y.backward()
        p = a @ b
        dp = 2 * (2 * np.sin(p) - 1) * 2 * np.cos(p)
        np.testing.assert_allclose(y.item(), ((2 * np.sin(p) - 1) ** 2).sum())
        np.testing.assert_allclose(x.grad, dp @ b.T)
        np.testing.assert_allclose(w.grad, a.T @ dp)
        y.backward()
        np.testing.assert_allclose(w.grad, 2 * (a.T @ dp))
        w.zero_grad()
        self.assertIsNone(w.grad)

    def test_gradients_have_gradients(self):
        x = stymo.Tensor(np.array([0.5, 2.0]), requires_grad=True)
        slope = stymo.grad((x * x * x).sum(), x, create_graph=True)
        slope.sum().backward()
        np.testing.assert_allclose(x.grad, 6 * np.array([0.5, 2.0]))

    def test_the_decoder_has_the_gradient_of_finite_differences(self):
        codes = np.stack([face.codes for face in model.sample(2)])
        angles = np.array([[10.0, 0, 0], [-20, 5, 0]])
        x = stymo.Tensor(codes, requires_grad=True)
        image = model.decode(x, angles, size=64)
        dL_dimage = 2 * image.numpy()  # L: the sum of the squared values
        image.backward(dL_dimage)
        direction = x.grad / np.linalg.norm(x.grad)

        def loss(step):
            moved = stymo.Tensor(codes + np.float32(step) * direction)
            return np.square(np.float64(model.decode(moved, angles, 64).numpy())).sum()

        h = 0.0003  # longer steps cross kinks of the leaky ReLUs
        slope = (loss(h) - loss(-h)) / (2 * h)
        self.assertAlmostEqual(slope / np.linalg.norm(x.grad), 1.0, delta=1e-3)

    def test_misuse_has_one_line(self):
        x = stymo.Tensor(np.ones((2, 3)))
        fails = Misuse().fails
        fails(RuntimeError, "no tensor with requires_grad=True leads", x.sum().backward)
        fails(ValueError, "matmul", lambda: x @ x)
        fails(ValueError, "not contiguous", lambda: stymo.Tensor(np.ones((2, 3)).T))
        fails(TypeError, "elements of type int64", lambda: stymo.Tensor(np.arange(3)))
        fails(ValueError, "codes: the shape is (2, 3); give (faces, 306)",
              lambda: model.decode(x))
        codes = stymo.Tensor(np.zeros((2, 306), np.float32))
        fails(ValueError, "angles: the shape is (3); give (2, 3)",
              lambda: model.decode(codes, np.zeros(3)))


if __name__ == "__main__":
    unittest.main()
