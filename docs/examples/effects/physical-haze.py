# SPDX-License-Identifier: Apache-2.0
"""haze: side lobes carry something of what is bright into what lies beside it.

A full bladder with the machine `classic`. Without the effect its edges are clean.
"""
from torso import bladder


def show(torso):
    view = bladder(torso, machine="classic")
    on, off = view.pair("haze")
    fluid = view.area_of("urinary_bladder")
    return on, off, "mean grey of the bladder", on[fluid].mean(), off[fluid].mean()
