# SPDX-License-Identifier: Apache-2.0
"""pack: labels, textures and the mannequin's surface become one file, the case that the player opens.

A small body and the built-in textures at their coarsest. The file is what `sonocase.Case.open` and `sonoplay` take.
"""
import json

import numpy as np

from body import HALF_AXES_MM, cooked, sonocase, stage


def show(folder):
    labels = cooked(folder)
    stage(folder, "texture", "--edge", 8, "-o", folder / "bank.textures")
    sonocase("pack", "--labels", labels, "--textures", folder / "bank.textures", "--surface", folder / "readings.csv",
             "--axes", "ras", "-o", folder / "case.sonocase")
    labels = json.loads(sonocase("inspect", folder / "case.sonocase", "--json"))["labels"]
    body_ml = sum(label["volume_ml"] for label in labels if label["name"] != "outside")
    return "volume of the packed body, ml", body_ml, 4e-3 / 3 * np.pi * np.prod(HALF_AXES_MM + 5), 0.03
