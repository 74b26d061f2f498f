# SPDX-License-Identifier: Apache-2.0
"""surface: the patient's skin as points, outward normals and triangles, out of the label map.

The area of an ellipsoid is known (Thomsen's formula, within 1 %).
"""
import numpy as np

from body import HALF_AXES_MM, stage, torso


def show(folder):
    labels, table = torso(folder)
    report = stage(folder, "surface", "--labels", labels, "--table", table, "-o", folder / "skin.surface")
    a, b, c = (HALF_AXES_MM / 10) ** 1.6075
    area_cm2 = 4 * np.pi * ((a * b + a * c + b * c) / 3) ** (1 / 1.6075)
    return "area of the skin, cm2", report["skin_area_cm2"], area_cm2, 0.05
