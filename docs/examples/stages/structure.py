# SPDX-License-Identifier: Apache-2.0
"""structure: vessel trees, septa and layers are baked into the echo of cooked labels, and the mean echo stays.

The liver of a small body.
"""
from body import cooked, stage


def show(folder):
    report = stage(folder, "structure", cooked(folder), "-o", folder / "structured.labels")
    assert report["vessel_pieces"] > 10
    return "mean offset of a label, dB, at most", report["worst_mean_offset_db"], 0, 0.13
