# SPDX-License-Identifier: Apache-2.0
"""replay_and_score.py BUNDLE SESSION: renders a recorded session again and prints its scores."""

import sys

import numpy as np

import sonocase


def main(bundle, path):
    case = sonocase.Case.open(bundle)
    session = sonocase.read_session(path)
    renderer = sonocase.Renderer(case, session["exercise"], size=(256, 256))
    in_plane = frames = 0
    for n in np.flatnonzero(session["probe_ok"]):
        needle = session["mannequin_from_drawn_needle"][n] if session["needle_ok"][n] else None
        renderer.render(session["mannequin_from_probe"][n], needle, session["time_s"][n],
                        frame=session["frame"][n])
        tip = renderer.truth([])[1]["tip"]
        frames += 1
        in_plane += tip is not None and tip["in_plane"]
    print(f"{frames} frames rendered, the tip in the plane in {in_plane}")
    for name, value in sonocase.score(case, path)["metrics"].items():
        if value is not None:
            print(f"{name:32} {value:10.3f}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: replay_and_score.py BUNDLE SESSION")
    main(*sys.argv[1:])
