# SPDX-License-Identifier: Apache-2.0
"""fine_structure: what is finer than a voxel: strands of muscle, septa of fat, bundles of nerves.

The muscle of the back along its fibres, under a linear probe. Without the effect its ground is even.
"""
from torso import back, changed


def show(torso):
    view = back(torso)
    on, off = view.pair("fine_structure")
    soft = view.area_of("muscle", "fat")
    return on, off, "change in muscle and fat and elsewhere", *changed(on, off, soft)
