"""stymo, a style-based neural 3D morphable face model, on the CPU.

    import stymo
    model = stymo.Model.load()
    face = model.fit(photo)               # (height, width, 3), uint8
    image = model.render(face, yaw=25)    # (256, 256, 3), float32 in [0, 1]
"""

import os

# Threads that wait sleep soon (docs/decisions.md); OpenMP reads this when it is loaded.
os.environ.setdefault("GOMP_SPINCOUNT", "1000")

from ._stymo import Face, Mesh, Model, Tensor, __version__, grad, set_threads  # noqa: E402

#: Where each group of codes stands in the 306 elements of `Face.codes`.
GROUPS = {"id": slice(0, 100), "expr": slice(100, 179), "tex": slice(179, 279),
          "light": slice(279, 306)}

__all__ = ["Face", "GROUPS", "Mesh", "Model", "Tensor", "__version__", "grad", "set_threads"]
