# SPDX-License-Identifier: Apache-2.0
"""parenchyma: the echo of liver, spleen, kidney and glands is uneven over some millimetres and some centimetres.

Without the effect a liver is speckle alone.
"""
from torso import changed, liver


def show(torso):
    view = liver(torso)
    on, off = view.pair("parenchyma")
    return on, off, "change in the liver and elsewhere", *changed(on, off, view.area_of("liver"))
