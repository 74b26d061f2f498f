# SPDX-License-Identifier: Apache-2.0
"""frame_and_overlay.py BUNDLE OUT.ppm: a frame beside the same frame with its labels in colour."""

import sys

import numpy as np

import sonocase


def main(bundle, out):
    case = sonocase.Case.open(bundle)
    exercise = case.exercise()
    start = exercise.start_pose
    pose = sonocase.Pose.on_skin(case, start[:3, 3], start[:3, 2])
    renderer = sonocase.Renderer(case, exercise)
    picture = renderer.render(pose)
    planes, facts = renderer.truth()
    for organ in sorted(facts["visible"], key=lambda o: -o["area_mm2"])[:8]:
        print(f"{organ['name']:28} {organ['area_mm2'] / 100:7.1f} cm2")
    palette = np.array([label.colour for label in case.labels], float)
    grey = np.repeat(picture[..., None].astype(float), 3, axis=2)
    overlay = np.where(planes.labels[..., None] > 0, 0.65 * grey + 0.35 * palette[planes.labels], grey)
    overlay[planes.shadowed > 0] *= 0.6
    both = np.concatenate([grey, overlay], axis=1).clip(0, 255).astype(np.uint8)
    with open(out, "wb") as file:
        file.write(b"P6\n%d %d\n255\n" % (both.shape[1], both.shape[0]) + both.tobytes())


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: frame_and_overlay.py BUNDLE OUT.ppm")
    main(*sys.argv[1:])
