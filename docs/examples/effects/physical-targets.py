# SPDX-License-Identifier: Apache-2.0
"""targets: the lesions, cysts and abscesses of the exercise, balls with their own echo, attenuation and wall.

The plane of the biopsy's own script. Without the effect the liver is healthy.
"""
import numpy as np

from torso import View


def show(torso):
    exercise = torso.case.exercise("liver-biopsy")
    view = View(torso, exercise.sweep_poses("needle")[0], exercise.probe, {"exercise": exercise})
    on, off = view.pair("targets")
    ball = view.near(exercise.targets[0].centre_mm, exercise.targets[0].radius_mm)
    change = np.abs(on.astype(float) - off)
    return on, off, "change in the lesion and elsewhere", change[ball].mean(), change[~ball].mean()
