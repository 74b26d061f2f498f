# SPDX-License-Identifier: Apache-2.0
"""pulsation: the walls of arteries move out at each beat, and back more slowly.

The femoral artery at the height of a beat, a sixth of a beat after its start. Without the effect the wall rests.
"""
from torso import changed, groin


def show(torso):
    view = groin(torso, exercise="femoral-access", time_s=0.13)
    on, off = view.pair("pulsation")
    artery = view.area_of("iliac_artery_left", "artery", "blood")
    return on, off, "change at the vessels and elsewhere", *changed(on, off, artery)
