# SPDX-License-Identifier: Apache-2.0
"""near_field: the face rings after its pulse, and hears nothing else while it does.

Fat under a linear probe. Without the effect tissue is as bright at the face as below it.
"""
from torso import LINEAR, changed


def show(torso):
    view = torso.view("autochthon_right", (0, -0.4, -1), (1, 0, 0), dict(LINEAR, depth_mm=60), pressed_mm=1)
    on, off = view.pair("near_field")
    return on, off, "change in the first 5 mm and beyond 20 mm", *changed(on, off, view.depth(0, 5), view.depth(20))
