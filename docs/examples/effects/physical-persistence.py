# SPDX-License-Identifier: Apache-2.0
"""persistence: the noise of several frames is averaged. Speckle belongs to the tissue and stays.

A full bladder with the machine `classic`. Without the effect fluid flickers more.
"""
from torso import bladder


def show(torso):
    view = bladder(torso, machine="classic")
    on, off = view.pair("persistence")
    fluid = view.near(torso.middle("urinary_bladder"), 15)
    return on, off, "standard deviation of the bladder's grey, without and with", off[fluid].std(), on[fluid].std()
