# SPDX-License-Identifier: Apache-2.0
"""diaphragm: between liver and lung a soft bright line, and behind it the liver once more, as in a mirror.

Without the effect the lung begins with the bright face of gas and its dirty shadow.
"""
from torso import FAN, changed


def show(torso):
    view = torso.view("liver", (0, -0.5, 1), (0, 1, 0), FAN, aside_mm=(30, 0, 0), gain_db=-8)
    on, off = view.pair("diaphragm")
    lung = view.area_of("lung")
    return on, off, "change in the lung and elsewhere", *changed(on, off, lung)
