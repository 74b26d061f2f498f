# SPDX-License-Identifier: Apache-2.0
"""edge_shadow: a beam that grazes the wall of fluid loses energy along it, by refraction.

Without the effect no dark lines hang from the edges of the gall bladder.
"""
from torso import FAN, changed


def show(torso):
    view = torso.view("gallbladder", (-0.4, -0.3, 1), (0, 1, 0), dict(FAN, depth_mm=130))
    on, off = view.pair("edge_shadow")
    return on, off, "change below the gall bladder and above it", *changed(on, off, view.depth(50), view.depth(0, 25))
