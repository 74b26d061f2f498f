# SPDX-License-Identifier: Apache-2.0
"""worth_of_images.py BUNDLE EXERCISE FOLDER [DRAWS]: what synthetic images are worth to who has a few real ones.

FOLDER as for tiny_segmenter.py, whose features and forest are used. Every other frame that shows a vessel is a test; of the
rest n are drawn to learn from, DRAWS times (5), and none that nearly is a frame of the test. With ours, 40 synthetic frames
weigh as much as the n real ones together; with n = 0 there are ours alone.
"""

import pathlib
import sys

import numpy as np
from PIL import Image
from sklearn.ensemble import RandomForestClassifier

from tiny_segmenter import features, squared, synthetic

COUNTS = (0, 1, 2, 4, 8, 16, 32)
PER_FRAME = 600  # pixels of each kind
TWINS = 0.9      # correlation of two frames from which on they are one scene


def real_frames(folder):
    """[(picture, mask)] of those that show a vessel."""
    frames = []
    for path in sorted(pathlib.Path(folder, "images").glob("*.png")):
        colours = np.asarray(Image.open(pathlib.Path(folder, "masks", path.name)).convert("RGB"))
        mask = squared(((colours[..., 1] > 127) & (colours[..., 0] < 128)).astype(np.uint8), Image.NEAREST)
        if mask.any():
            frames.append((squared(np.asarray(Image.open(path).convert("L"))), mask))
    return frames


def apart(pool, test):
    """Those of the pool that are no frame of the test seen again."""
    def small(picture):
        values = np.asarray(Image.fromarray(picture).resize((64, 64)), float).ravel()
        return (values - values.mean()) / (values.std() + 1e-9) / np.sqrt(values.size)

    seen = np.stack([small(picture) for picture, _ in test])
    return [frame for frame in pool if (seen @ small(frame[0])).max() < TWINS]


def drawn(x, mask, random):
    """Rows of features and their classes, as many of a vessel as of the rest."""
    y = mask.ravel() > 0
    few = min(y.sum(), (~y).sum(), PER_FRAME)
    chosen = np.concatenate([random.choice(np.flatnonzero(y == kind), few, False) for kind in (True, False)])
    return x[chosen], y[chosen]


def forest_of(*groups):
    """Learned from groups of samples, each of which weighs as much as the others."""
    parts = [(x, y, np.full(len(y), 1 / sum(len(y) for _, y in group))) for group in groups for x, y in group]
    x, y, weight = map(np.concatenate, zip(*parts))
    forest = RandomForestClassifier(60, max_depth=12, min_samples_leaf=5, random_state=1, n_jobs=1)
    return forest.fit(x, y, weight)


def area(likely, mask):
    """Under the ROC curve: how often a vessel's pixel ranks above another; equals count half."""
    inside, outside = np.sort(likely[mask]), likely[~mask]
    below = np.searchsorted(inside, outside, "left") + np.searchsorted(inside, outside, "right")
    return 1 - below.mean() / 2 / len(inside)


def main(bundle, exercise, folder, draws=5):
    frames = real_frames(folder)
    test = frames[::2]
    pool = apart(frames[1::2], test) if test else []
    if len(pool) < 2:
        sys.exit(f"{folder}: {len(frames)} frames show a vessel; expected images/*.png and masks/*.png of at least four scenes")
    random = np.random.default_rng(1)
    ours = [drawn(features(p), t, random) for p, t in zip(*synthetic(bundle, exercise, 40, random)) if t.any()]
    if not ours:
        sys.exit("no vessel in sight; give an exercise that shows one")
    test = [(features(picture), mask.ravel() > 0) for picture, mask in test]
    pool = [(features(picture), mask) for picture, mask in pool]
    print(f"{len(test)} real frames to test, {len(pool)} to learn from; median area under the ROC curve, 0.5 is chance\n")
    print("real   alone           with ours       with ours - alone, frame by frame")
    for count in [n for n in COUNTS if n <= len(pool)]:
        areas = [[], []]  # alone, with ours; by draw and frame
        for draw in range(draws if 0 < count < len(pool) else 1):
            random = np.random.default_rng([count, draw])
            real = [drawn(*pool[i], random) for i in random.choice(len(pool), count, False)]
            for with_ours in (0, 1):
                groups = [group for group in (real, ours if with_ours else []) if group]
                forest = forest_of(*groups) if groups else None
                areas[with_ours].append([area(forest.predict_proba(x)[:, 1], mask) if forest else 0.5
                                         for x, mask in test])
        alone, with_ours = map(np.array, areas)
        middle = [np.median(a, axis=1) for a in (alone, with_ours)]
        more = np.median(with_ours - alone, axis=1)
        print(f"{count:4d}   " + "   ".join(f"{m.mean():.3f} ± {m.std():.3f}" for m in (*middle, more)), flush=True)


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5) or not all(given.isdigit() and int(given) > 0 for given in sys.argv[4:]):
        sys.exit("usage: worth_of_images.py BUNDLE EXERCISE FOLDER [DRAWS]")
    main(*sys.argv[1:4], *map(int, sys.argv[4:]))
