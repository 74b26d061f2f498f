# SPDX-License-Identifier: Apache-2.0
"""noise: the receiver's own, drawn anew for each frame; it shows where there is nothing else to hear.

A full bladder with the machine `classic`. Without the effect fluid is black.
"""
from torso import bladder


def show(torso):
    view = bladder(torso, machine="classic")
    on, off = view.pair("noise")
    fluid = view.near(torso.middle("urinary_bladder"), 15)
    return on, off, "mean grey of the bladder", on[fluid].mean(), off[fluid].mean()
