# SPDX-License-Identifier: Apache-2.0
"""tiny_segmenter.py BUNDLE EXERCISE FOLDER: finds vessels in real frames after learning from ours alone.

FOLDER holds images/NAME.png and masks/NAME.png, vessels green in the masks. A forest of small trees judges each pixel by means
and deviations around it; it is no match for a network, and shows how far the pictures carry.
Needs python3-sklearn, python3-scipy and python3-pil.
"""

import pathlib
import sys

import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter
from sklearn.ensemble import RandomForestClassifier

import sonocase

EDGE = 192  # pixels of a frame, ours and real


def features(picture):
    """(pixels, n): how dark and how even it is around a pixel, against its wider surroundings.

    Ratios of means alone: gain and grey map differ from machine to machine.
    """
    grey = picture.astype(float) + 4
    wide = gaussian_filter(grey, 24)
    planes = []
    for scale in (2, 4, 8):
        mean = gaussian_filter(grey, scale)
        planes += [np.log(mean / wide),
                   np.sqrt(np.maximum(gaussian_filter(grey**2, scale) - mean**2, 0)) / wide]
    return np.stack(planes, axis=-1).reshape(-1, len(planes))


def cropped(picture, inside):
    """The picture of a linear probe without its black margins."""
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    return picture[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1]


def squared(picture, kind=Image.BILINEAR):
    return np.asarray(Image.fromarray(picture).resize((EDGE, EDGE), kind))


def synthetic(bundle, name, count, random):
    case = sonocase.Case.open(bundle)
    exercise = case.exercise(name)
    renderer = sonocase.Renderer(case, exercise, size=(384, 384))
    vessels = [i for i, label in enumerate(case.labels) if label.tissue in ("blood", "vessel", "vein", "artery")]
    start = exercise.start_pose
    x, y = [], []
    while len(x) < count:
        near = start[:3, 3] + start[:3, :2] @ random.uniform(-20, 20, 2)
        pose = sonocase.Pose.on_skin(case, near, start[:3, 2])
        if pose is None:
            continue
        picture = renderer.render(sonocase.Pose.turned(pose, *random.uniform(-0.3, 0.3, 3)),
                                  time_s=random.uniform(0, 5), frame=len(x))
        planes, _ = renderer.truth(["labels", "skin_depth_mm"])
        inside = ~np.isnan(planes.skin_depth_mm)
        truth = cropped(np.isin(planes.labels, vessels).astype(np.uint8), inside)
        x.append(squared(cropped(picture, inside)))
        y.append(squared(truth, Image.NEAREST))
    return x, y


def main(bundle, exercise, folder):
    real = sorted(pathlib.Path(folder, "images").glob("*.png"))[:12]
    if not real:
        sys.exit(f"{folder}: no images/*.png")
    random = np.random.default_rng(1)
    pictures, truths = synthetic(bundle, exercise, 40, random)
    x = np.concatenate([features(p) for p in pictures])
    y = np.concatenate([t.ravel() for t in truths])
    if not y.any():
        sys.exit("no vessel in sight; give an exercise that shows one")
    yes, no = np.flatnonzero(y), np.flatnonzero(y == 0)
    few = min(len(yes), 20000)
    chosen = np.concatenate([random.choice(yes, few, False), random.choice(no, few, False)])
    forest = RandomForestClassifier(60, max_depth=12, random_state=1, n_jobs=1)
    forest.fit(x[chosen], y[chosen])

    areas = []  # under the ROC curve: how often a vessel's pixel ranks above another
    for path in real:
        colours = np.asarray(Image.open(pathlib.Path(folder, "masks", path.name)).convert("RGB"))
        green = (colours[..., 1] > 127) & (colours[..., 0] < 128)
        mask = squared(green.astype(np.uint8), Image.NEAREST).ravel() > 0
        if not mask.any():
            continue
        likely = forest.predict_proba(features(squared(np.asarray(Image.open(path).convert("L")))))[:, 1]
        order = np.empty(len(likely))
        order[np.argsort(likely, kind="stable")] = np.arange(len(likely))
        inside, outside = mask.sum(), (~mask).sum()
        areas.append((order[mask].sum() - inside * (inside - 1) / 2) / (inside * outside))
        print(f"{path.name}: area under the curve {areas[-1]:.2f}")
    print(f"{len(areas)} real frames, median {np.median(areas):.2f}; 0.5 is chance")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit("usage: tiny_segmenter.py BUNDLE EXERCISE FOLDER")
    main(*sys.argv[1:])
