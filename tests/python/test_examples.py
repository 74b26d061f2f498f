# SPDX-License-Identifier: Apache-2.0
"""The programs of docs/examples/python, run on a small case as a reader would."""

import importlib
import pathlib
import re
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

import sonocase
from test_dataset import recipe  # noqa: F401  (a fixture)

EXAMPLES = pathlib.Path(__file__).parents[2] / "docs" / "examples" / "python"


def run(name, *arguments, check=True):
    return subprocess.run([sys.executable, EXAMPLES / name, *map(str, arguments)], check=check,
                          capture_output=True, text=True)


def test_frame_and_overlay(small, tmp_path):
    printed = run("frame_and_overlay.py", small[0], tmp_path / "out.ppm").stdout
    assert "muscle" in printed and "vessel" in printed
    header, size, depth, pixels = (tmp_path / "out.ppm").read_bytes().split(b"\n", 3)
    assert (header, size, depth) == (b"P6", b"1024 512", b"255")
    both = np.frombuffer(pixels, np.uint8).reshape(512, 1024, 3).astype(int)
    grey, overlay = both[:, :512], both[:, 512:]
    assert (grey.max(axis=2) == grey.min(axis=2)).all()
    assert (overlay.max(axis=2) > overlay.min(axis=2)).mean() > 0.2  # labels are coloured


def test_dataset_statistics(recipe, sonoplay, tmp_path):
    sonoplay("dataset", recipe, "-o", tmp_path / "out", "--frames", 12)
    printed = run("dataset_statistics.py", tmp_path / "out").stdout
    assert printed.startswith("12 frames: 6 test, 6 train")
    assert "muscle" in printed and "% of the beams touch the skin" in printed


def test_replay_and_score(small):
    printed = run("replay_and_score.py", *small).stdout
    assert int(re.match(r"(\d+) frames rendered", printed)[1]) > 0
    assert printed.count("\n") > 3  # scores follow


def test_tiny_segmenter(small, case, pose, tmp_path):
    """On frames of its own kind: what it learns from it must find again."""
    empty = run("tiny_segmenter.py", small[0], "scan", tmp_path, check=False)
    assert empty.returncode == 1 and "no images" in empty.stderr
    renderer = sonocase.Renderer(case, "scan", size=(384, 384))
    vessel = [i for i, label in enumerate(case.labels) if label.name == "vessel"]
    for kind in ("images", "masks"):
        (tmp_path / kind).mkdir()
    for n in range(2):
        picture = renderer.render(sonocase.Pose.moved(pose, (2.0 * n, 0, 0)), frame=n)
        mask = np.zeros((384, 384, 3), np.uint8)
        mask[..., 1] = 255 * np.isin(renderer.truth(["labels"])[0].labels, vessel)
        Image.fromarray(picture).save(tmp_path / "images" / f"{n}.png")
        Image.fromarray(mask).save(tmp_path / "masks" / f"{n}.png")
    printed = run("tiny_segmenter.py", small[0], "scan", tmp_path).stdout
    median = float(re.search(r"2 real frames, median ([0-9.]+)", printed)[1])
    assert median > 0.8  # 0.5 is chance


def disc_in_noise(random):
    """A frame whose vessel is a dark disc in bright grain."""
    v, u = np.mgrid[:192, :192]
    inside = np.hypot(u - random.uniform(50, 142), v - random.uniform(50, 142)) < random.uniform(12, 25)
    return np.where(inside, 30, random.integers(60, 255, (192, 192))).astype(np.uint8), inside


def test_worth_of_images(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    worth = importlib.import_module("worth_of_images")
    assert worth.area(np.array([0.1, 0.9, 0.5, 0.5]), np.array([False, True, True, False])) == 0.875
    for kind in ("images", "masks"):
        (tmp_path / kind).mkdir()
    random = np.random.default_rng(3)
    frames = [disc_in_noise(random) for _ in range(6)]
    frames[5] = frames[4]  # one of the pool is one of the test
    for n, (picture, inside) in enumerate(frames):
        mask = np.zeros((192, 192, 3), np.uint8)
        mask[..., 1] = 255 * inside
        Image.fromarray(picture).save(tmp_path / "images" / f"{n}.png")
        Image.fromarray(mask).save(tmp_path / "masks" / f"{n}.png")
    monkeypatch.setattr(worth, "synthetic", lambda *_: tuple(zip(*[disc_in_noise(random) for _ in range(3)])))
    monkeypatch.setattr(worth, "COUNTS", (0, 2))
    worth.main("bundle", "exercise", tmp_path, 2)
    printed = capsys.readouterr().out
    assert printed.startswith("3 real frames to test, 2 to learn from")
    rows = [list(map(float, re.findall(r"[0-9.]+", line))) for line in printed.splitlines()[3:]]
    assert [row[0] for row in rows] == [0, 2] and rows[0][1] == 0.5
    assert rows[0][3] > 0.9 and rows[1][1] > 0.9 and rows[1][3] > 0.9  # of a kind that a disc makes easy
    with pytest.raises(SystemExit, match="at least four scenes"):
        worth.main("bundle", "exercise", tmp_path / "none", 2)


@pytest.mark.parametrize("name", sorted(path.name for path in EXAMPLES.glob("*.py")))
def test_wrong_usage_is_one_line(name):
    done = run(name, check=False)
    assert done.returncode == 1 and done.stderr.startswith("usage: ") and done.stderr.count("\n") == 1
