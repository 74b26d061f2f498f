# SPDX-License-Identifier: Apache-2.0
"""edge_enhancement: an unsharp mask over the finished picture.

No built-in machine has it: here `modern` with an amount of 1. Without the effect edges are softer.
"""
import pathlib
import tempfile

import numpy as np

from torso import kidney


def show(torso):
    with tempfile.TemporaryDirectory() as folder:
        machine = pathlib.Path(folder, "sharpened.toml")
        machine.write_text('[machine]\nedge_enhancement = 1\n')
        on, off = kidney(torso, machine=str(machine)).pair("edge_enhancement")
    step = [np.abs(np.diff(p.astype(float), axis=0)).mean() for p in (on, off)]
    return on, off, "step from pixel to pixel down the picture", *step
