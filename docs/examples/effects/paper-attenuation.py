# SPDX-License-Identifier: Apache-2.0
"""attenuation in model `paper`: the whole picture gets darker with depth, by exp(-depth / 250 mm), whatever lies above.

Without the effect the deep is as bright as the near.
"""
from torso import liver


def show(torso):
    view = liver(torso, model="paper")
    on, off = view.pair("attenuation")
    deep = view.depth(100)
    return on, off, "mean grey beyond 100 mm, without and with", off[deep].mean(), on[deep].mean()
