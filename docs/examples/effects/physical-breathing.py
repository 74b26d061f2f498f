# SPDX-License-Identifier: Apache-2.0
"""breathing: at the height of a breath organs under the diaphragm lie lower, skin and bone where they were.

The right kidney half a period into the breath. Without the effect it rests.
"""
import numpy as np

from torso import kidney


def show(torso):
    period_s = torso.case.exercise("deep-biopsy").breathing["period_s"]
    view = kidney(torso, exercise="deep-biopsy", time_s=period_s / 2)
    on, off = view.pair("breathing")
    breath = view.truth.labels
    view.draw("auto", time_s=0)
    return on, off, "pixels whose organ is another than at rest, and without", np.sum(breath != view.truth.labels), 0
