# SPDX-License-Identifier: Apache-2.0
"""import: a label map of any kind becomes labels in the ct frame (RAS+, mm), with tissues by their names.

A body that is an ellipsoid of 50, 38 and 55 mm, as a MetaImage with a table.
"""
import numpy as np

from body import stage, torso


def show(folder):
    labels, table = torso(folder)
    report = stage(folder, "import", labels, "--table", table, "-o", folder / "ct.labels")
    return "volume of the body, ml", report["body_volume_ml"], 4 / 3 * np.pi * 5.0 * 3.8 * 5.5, 0.01
