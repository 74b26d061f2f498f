# SPDX-License-Identifier: Apache-2.0
"""pathology: lesions of a recipe are put into cooked labels, each with the volume that was asked for.

A metastasis of 9 ml in the liver of the analytic torso. The stage has no verb of its own: it takes a recipe's lesions.
"""
import json

from body import sonocase

RECIPE = """
name = "sick"
preset = "draft"
analytic = { voxel_mm = 4, slice_mm = 4, known_map = true, strength = 0 }
resample = { voxel_mm = 4 }
pathology = [{ name = "metastasis_1", kind = "metastasis", host = "liver", volume_ml = 9, seed = 3 }]
"""


def show(folder):
    (folder / "case.toml").write_text(RECIPE)
    sonocase("build", folder / "case.toml", "--quiet", "-o", folder / "sick.sonocase")
    labels = json.loads(sonocase("inspect", folder / "sick.sonocase", "--json"))["labels"]
    lesion = next(label for label in labels if label["name"].startswith("metastasis_1"))
    return "volume of the lesion, ml", lesion["volume_ml"], 9, 0.1
