# SPDX-License-Identifier: Apache-2.0
"""texture: a solid texture that wraps round is learned from a picture, with its histogram and its grain.

Noise that is twice as long along the picture's x as along its y.
"""
import numpy as np
from PIL import Image

from body import stage


def show(folder):
    grain = np.random.default_rng(1).normal(size=(128, 128))
    for axis, sigma in ((0, 1), (1, 2)):
        kernel = np.exp(-np.arange(-8, 9) ** 2 / (2 * sigma**2))
        grain = np.apply_along_axis(np.convolve, axis, grain, kernel, "same")
    Image.fromarray(np.clip(128 + 32 * grain / grain.std(), 0, 255).astype(np.uint8)).save(folder / "grain.png")
    report = stage(folder, "texture", f"grain={folder / 'grain.png'}", "--edge", 32, "-o", folder / "grain.textures")
    return "grain along / across", report["grain.along_px"] / report["grain.across_px"], 2, 0.1
