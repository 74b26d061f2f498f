# SPDX-License-Identifier: Apache-2.0
"""grey_map: after a logarithm, dark greys get darker and bright ones brighter.

The kidney with the machine `classic`. Without the effect the picture is flatter.
"""
from torso import kidney


def show(torso):
    view = kidney(torso, machine="classic")
    on, off = view.pair("grey_map")
    return on, off, "standard deviation of all grey", on[view.scanned].std(), off[view.scanned].std()
