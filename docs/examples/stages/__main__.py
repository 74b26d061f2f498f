# SPDX-License-Identifier: Apache-2.0
"""Each stage shown alone, on a body whose answer is known.

    python3 docs/examples/stages FOLDER [NAME...]

runs the sample NAME.py beside this file (all by default) in FOLDER/NAME and prints what it found and what is right.
Needs python3-numpy and python3-pil, and the programs of build/release.
"""

import importlib
import pathlib
import sys

NAMES = ["import", "surface", "warp", "resample", "smooth", "pathology", "texture", "structure", "flow", "pack"]


def run(name, folder):
    """(text, found, right, tolerance)"""
    place = pathlib.Path(folder, name)
    place.mkdir(parents=True, exist_ok=True)
    return importlib.import_module(name).show(place)


def main(folder, *names):
    unknown = sorted(set(names) - set(NAMES))
    if unknown:
        sys.exit(f"no sample {unknown[0]}; expected one of {', '.join(NAMES)}")
    for name in names or NAMES:
        text, found, right, _ = run(name, folder)
        print(f"{name}: {text}: {found:.3g} ({right:.3g})")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("usage: python3 docs/examples/stages FOLDER [NAME...]")
    main(*sys.argv[1:])
