# SPDX-License-Identifier: Apache-2.0
"""interfaces: the echo of a surface, by the step in impedance and the angle of the beam: bone, capsule, fascia.

Without the effect the face of a rib is no brighter than what lies above it.
"""
import numpy as np

from torso import rib


def show(torso):
    view = rib(torso)
    on, off = view.pair("interfaces")
    bone = view.area_of("bone")
    return on, off, "99th percentile of the grey at the rib", np.percentile(on[bone], 99), np.percentile(off[bone], 99)
