# SPDX-License-Identifier: Apache-2.0
"""flow: the courses of labelled vessels, and the blood that runs through them.

300 ml/min in a straight tube: the mean velocity is the flow over the section that was found.
"""
import csv

import numpy as np

from body import cooked, stage


def show(folder):
    stage(folder, "flow", cooked(folder), "--unknown-ml-min", 300, "--unknown-wave", "steady", "-o", folder / "flow.csv")
    with open(folder / "flow.csv") as table:
        tube = next(csv.DictReader(table))
    section_cm2 = np.pi * (float(tube["diameter_mm"]) / 20) ** 2
    return "mean velocity, cm/s", float(tube["mean_cm_s"]), 300 / 60 / section_cm2, 0.01
