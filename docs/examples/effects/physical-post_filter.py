# SPDX-License-Identifier: Apache-2.0
"""post_filter: the finished picture is smoothed by [1 2 1] along the beam and across it.

The kidney with the machine `classic`. Without the effect grain is sharper.
"""
import numpy as np

from torso import kidney


def show(torso):
    view = kidney(torso, machine="classic")
    on, off = view.pair("post_filter")
    step = [np.abs(np.diff(p.astype(float), axis=1)).mean() for p in (off, on)]
    return on, off, "step from pixel to pixel, without and with", *step
