# SPDX-License-Identifier: Apache-2.0
"""Data sets: the same bytes however they were sharded and interrupted, and truth beside each frame."""

import json
import os
import pathlib
import resource
import signal
import subprocess

import numpy as np
import pytest

import sonocase
from conftest import BIN
from pictures import read_png

RECIPE = """
name = "try"
size = [64, 48]
chunk = 3
format = "{format}"
[[cases]]
bundle = "small.sonocase"
[[cases]]
bundle = "small.sonocase"
split = "test"
exercises = ["scan"]
[poses]
tilt_deg = 20
rotate_deg = 180
pressed_mm = [-2, 4]
[machine]
model = "paper"
depth_mm = [60, 90]
gain_db = [-6, 6]
[needle]
share = 0.5
gauge = [18, 22]
"""


@pytest.fixture
def recipe(small, tmp_path):
    (tmp_path / "small.sonocase").symlink_to(small[0])
    path = tmp_path / "recipe.toml"
    path.write_text(RECIPE.format(format="png"))
    return path


def content_of(folder):
    return {str(p.relative_to(folder)): p.read_bytes()
            for p in sorted(pathlib.Path(folder).rglob("*")) if p.is_file()}


def test_any_number_of_shards_gives_the_same_bytes(recipe, sonoplay, tmp_path, hard_case):
    whole = tmp_path / "whole"
    sonoplay("dataset", recipe, "-o", whole, "--frames", 32, "--seed", 7)
    expected = content_of(whole)
    assert len(expected["manifest.jsonl"].splitlines()) == 32
    other_files = 0
    for shards in (2, 7):
        out = tmp_path / f"in{shards}"
        for shard in reversed(range(1, shards + 1)):
            sonoplay("dataset", recipe, "-o", out, "--frames", 32, "--seed", 7,
                     "--shard", f"{shard}/{shards}")
        other_files += files_that_differ(content_of(out), expected)
    hard_case("files that are other in 2 or 7 shards", other_files)
    other = tmp_path / "other"
    sonoplay("dataset", recipe, "-o", other, "--frames", 32, "--seed", 8)
    assert content_of(other)["manifest.jsonl"] != expected["manifest.jsonl"]


def files_that_differ(a, b):
    return sum(a.get(name) != b.get(name) for name in a.keys() | b.keys())


def test_three_kills_leave_no_trace(recipe, sonoplay, tmp_path, hard_case):
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    sonoplay("dataset", recipe, "-o", whole, "--frames", 60)
    for kill in range(3):
        process = subprocess.Popen([BIN / "sonoplay", "dataset", recipe, "-o", killed,
                                    "--frames", "60"])
        records = killed / "records"
        wanted = 4 * (kill + 1)
        while process.poll() is None and (
                not records.exists() or len(list(records.glob("*.jsonl"))) < wanted):
            pass
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert not (killed / "manifest.jsonl").exists()
    sonoplay("dataset", recipe, "-o", killed, "--frames", 60)
    hard_case("files that are other after three kills",
              files_that_differ(content_of(killed), content_of(whole)))


def test_more_frames_go_on_where_it_stopped(recipe, sonoplay, tmp_path):
    grown, whole = tmp_path / "grown", tmp_path / "whole"
    sonoplay("dataset", recipe, "-o", grown, "--frames", 10)
    sonoplay("dataset", recipe, "-o", grown, "--frames", 20)
    sonoplay("dataset", recipe, "-o", whole, "--frames", 20)
    assert content_of(grown) == content_of(whole)


def test_a_frame_is_what_its_record_says(recipe, sonoplay, tmp_path, case):
    out = tmp_path / "out"
    sonoplay("dataset", recipe, "-o", out, "--frames", 24, "--seed", 3)
    records = [json.loads(line) for line in (out / "manifest.jsonl").read_text().splitlines()]
    description = json.loads((out / "dataset.json").read_text())
    assert [l["name"] for l in description["cases"][0]["labels"]] == ["outside", "muscle", "vessel"]
    assert {r["split"] for r in records} == {"train", "test"}
    assert {r["depth_mm"] for r in records} == {60, 90}
    needles = sum(r["truth"]["mannequin_from_needle"] is not None for r in records)
    assert 4 <= needles <= 20  # a half of 24; 1 in 10,000 draws is further off
    for record in records:
        assert record["on_skin"]
        exercise = case.exercise(record["exercise"])
        probe = exercise.probe
        probe.depth_mm = record["depth_mm"]
        renderer = sonocase.Renderer(case, exercise, probe=probe, model="paper", size=(64, 48))
        truth = record["truth"]
        needle = truth["mannequin_from_needle"]
        if needle is not None and record["gauge"] != exercise.needle.gauge:
            continue  # this exercise has another needle
        picture = renderer.render(truth["mannequin_from_probe"], needle, truth["time_s"],
                                  frame=record["noise_frame"], gain_db=record["gain_db"])
        np.testing.assert_array_equal(read_png(out / record["image"]), picture)
        planes, _ = renderer.truth()
        name = f"{record['index']:08d}.png"
        np.testing.assert_array_equal(read_png(out / "frames" / f"labels_{name}"), planes.labels)
        np.testing.assert_array_equal(read_png(out / "frames" / f"needle_{name}"), planes.needle)


def test_arrays_hold_the_same_frames(recipe, sonoplay, tmp_path):
    pictures, arrays = tmp_path / "pictures", tmp_path / "arrays"
    sonoplay("dataset", recipe, "-o", pictures, "--frames", 7)
    recipe.write_text(RECIPE.format(format="npy"))
    sonoplay("dataset", recipe, "-o", arrays, "--frames", 7)
    for line in map(json.loads, (arrays / "manifest.jsonl").read_text().splitlines()):
        name = f"{line['index']:08d}.png"
        for kind, plane in (("image", "images"), ("labels", "labels"), ("needle", "needle"),
                            ("shadow", "shadow")):
            array = np.load(arrays / "arrays" / f"{plane}_{line['chunk']:06d}.npy", mmap_mode="r")
            np.testing.assert_array_equal(array[line["row"]],
                                          read_png(pictures / "frames" / f"{kind}_{name}"))
        assert np.load(arrays / "arrays" / f"depth_{line['chunk']:06d}.npy").dtype == np.float32


@pytest.mark.parametrize("change, words", [
    (("chunk = 3", "chunky = 3"), "chunky"), (("[64, 48]", "[64]"), "size"),
    (('split = "test"', 'split = "toast"'), "toast"), (('"scan"', '"scam"'), "scam"),
    (("small.sonocase", "none.sonocase"), "none.sonocase"),
    (("gain_db = [-6, 6]", "gain_db = [6, -6]"), "gain_db"), (('[needle]', '[needles]'), "needles"),
    (('model = "paper"', 'names = ["toaster"]'), "toaster"), (("name =", "name"), "recipe.toml")])
def test_a_bad_recipe_is_one_line_and_leaves_nothing(recipe, sonoplay, tmp_path, change, words):
    recipe.write_text(recipe.read_text().replace(*change))
    done = sonoplay("dataset", recipe, "-o", tmp_path / "out", "--frames", 3, check=False)
    assert done.returncode == 1 and words in done.stderr and done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_bad_arguments(recipe, sonoplay, tmp_path):
    for arguments in ((), ("--frames", 3, "--shard", "3/2"), ("--frames", 0),
                      ("--frames", 3, "--shard", "x"), ("--frames", 3, "--seed", -1), ("--frames", 3, "--seed", 10**20), ("--frames", -3),
                      ("--frames", 3, "--seed", "1.5"), ("--frames", 3, "--shard", "-1/2")):
        done = sonoplay("dataset", recipe, "-o", tmp_path / "out", *arguments, check=False)
        assert done.returncode == 2 and done.stderr.count("\n") == 1
    sonoplay("dataset", recipe, "-o", tmp_path / "out", "--frames", 3)
    done = sonoplay("dataset", recipe, "-o", tmp_path / "out", "--frames", 3, "--seed", 2,
                    check=False)
    assert done.returncode == 1 and "another data set" in done.stderr


def test_a_full_disk_is_one_line_and_the_rest_goes_on_later(recipe, sonoplay, tmp_path, hard_case):
    """Files of more than 2600 bytes cannot be written, as on a full disk."""
    def limited():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (2600, resource.RLIM_INFINITY))

    out = tmp_path / "out"
    done = subprocess.run([BIN / "sonoplay", "dataset", recipe, "-o", out, "--frames", "9"],
                          capture_output=True, text=True, preexec_fn=limited)
    assert done.returncode == 1 and done.stderr.count("\n") == 1 and str(out) in done.stderr
    assert not (out / "manifest.jsonl").exists()
    for name in content_of(out):
        if name.endswith(".png"):
            read_png(out / name)  # whole, or not there
    sonoplay("dataset", recipe, "-o", out, "--frames", 9)
    whole = tmp_path / "whole"
    sonoplay("dataset", recipe, "-o", whole, "--frames", 9)
    hard_case("files that are other after a full disk",
              files_that_differ(content_of(out), content_of(whole)))
