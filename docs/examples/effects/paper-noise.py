# SPDX-License-Identifier: Apache-2.0
"""noise in model `paper`: Gaussian, before the blur, drawn anew for each frame.

A full bladder. Without the effect fluid is even.
"""
from torso import bladder


def show(torso):
    view = bladder(torso, model="paper")
    on, off = view.pair("noise")
    fluid = view.near(torso.middle("urinary_bladder"), 15)
    return on, off, "standard deviation of the bladder's grey", on[fluid].std(), off[fluid].std()
