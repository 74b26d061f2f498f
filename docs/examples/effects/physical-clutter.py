# SPDX-License-Identifier: Apache-2.0
"""clutter: bright echoes are reflected between the layers of the wall and fade below it.

Without the effect fluid and vessels near the wall are black.
"""
from torso import bladder


def show(torso):
    view = bladder(torso)
    on, off = view.pair("clutter")
    fluid = view.area_of("urinary_bladder")
    return on, off, "mean grey of the bladder", on[fluid].mean(), off[fluid].mean()
