# SPDX-License-Identifier: Apache-2.0
"""attenuation: tissue takes sound; fluid takes little, so that what lies behind it is bright, and bone nearly all.

A full bladder. Without the effect depth gain alone works, and there is neither shadow nor enhancement.
"""
from torso import bladder


def show(torso):
    view = bladder(torso)
    on, off = view.pair("attenuation")
    shadow = view.truth.shadowed > 0
    return on, off, "mean grey of the shadows, without and with", off[shadow].mean(), on[shadow].mean()
