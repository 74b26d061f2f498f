# SPDX-License-Identifier: Apache-2.0
"""blur: the mean of nine copies of the picture, turned about the fan's centre; wider with depth, as a beam is.

Without the effect texture and noise are as sharp across the beam as along it.
"""
import numpy as np

from torso import liver


def show(torso):
    view = liver(torso, model="paper")
    on, off = view.pair("blur")
    step = [np.abs(np.diff(p.astype(float), axis=1)).mean() for p in (off, on)]
    return on, off, "step from pixel to pixel, without and with", *step
