# SPDX-License-Identifier: Apache-2.0
"""Each effect shown alone: on the left with it, on the right without it.

    python3 docs/examples/effects CASE FOLDER [NAME...]

writes FOLDER/NAME.png of each sample beside this file (all by default) and prints the figure that says what the effect did.
CASE: a bundle of scenarios/real-torso. Needs python3-numpy and python3-pil.
"""

import importlib
import pathlib
import sys

import numpy as np
from PIL import Image

import sonocase
from torso import Torso

HERE = pathlib.Path(__file__).parent
NAMES = sorted(path.stem for path in HERE.glob("p*-*.py"))  # MODEL-EFFECT


def show(name, torso):
    """(on, off, text, figure of on, figure of off): the first figure is the larger one."""
    return importlib.import_module(name).show(torso)


def side_by_side(on, off):
    return np.hstack([on, np.full((on.shape[0], 4), 90, np.uint8), off])


def main(bundle, folder, *names):
    unknown = sorted(set(names) - set(NAMES))
    if unknown:
        sys.exit(f"no sample {unknown[0]}; expected one of {', '.join(NAMES)}")
    torso = Torso(sonocase.Case.open(bundle))
    pathlib.Path(folder).mkdir(parents=True, exist_ok=True)
    for name in names or NAMES:
        on, off, text, larger, smaller = show(name, torso)
        Image.fromarray(side_by_side(on, off)).save(pathlib.Path(folder, name + ".png"), optimize=True)
        print(f"{name}: {text}: {larger:.3g}, {smaller:.3g}")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit("usage: python3 docs/examples/effects CASE FOLDER [NAME...]")
    main(*sys.argv[1:])
