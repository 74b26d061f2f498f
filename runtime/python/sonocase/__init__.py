# SPDX-License-Identifier: Apache-2.0
"""Ultrasound frames, labels and scores of case bundles.

    import sonocase
    case = sonocase.Case.open("real-torso.sonocase")
    renderer = sonocase.Renderer(case, exercise="liver-biopsy", size=(512, 512))
    picture = renderer.render(pose)             # uint8, (height, width)

Millimetres, seconds, radians; right-handed frames; poses are 4 x 4 arrays `mannequin_from_probe`
(x along the face, y across it, z into the body). Failures of the outside world raise
`sonocase.Error` with one line that says what, where and what was expected.

Arrays are NumPy's, of any version, where it can be imported, and `sonocase.Array` otherwise.
Arguments are arrays of any library that has the buffer protocol, `__array_interface__` or DLPack.
"""

from . import pose as Pose
from ._core import (
    Array,
    Case,
    Error,
    Exercise,
    Label,
    Needle,
    Probe,
    Renderer,
    Target,
    TruthPlanes,
    __version__,
    read_session,
    simd_targets,
)

__all__ = [
    "Array", "Case", "Error", "Exercise", "Label", "Needle", "Pose", "Probe", "Renderer", "Target",
    "TruthPlanes", "__version__", "read_session", "score", "simd_targets",
]


_LAZY = ("data", "domain", "environment")


def __dir__():
    return [*globals(), *_LAZY]


def score(case, session, exercise=None):
    """Scores of a recorded session, as a dict: docs/metrics.md defines each.

    case      the Case that it was recorded on
    session   path of the recording
    exercise  an Exercise; by default the one that the recording names
    """
    import json

    return json.loads(Case._score(case, session, exercise))


def __getattr__(name):
    # Only programs that use them pay for them, and need NumPy.
    if name in _LAZY:
        import importlib

        return importlib.import_module(f".{name}", __name__)
    raise AttributeError(f"module 'sonocase' has no attribute {name!r}")
