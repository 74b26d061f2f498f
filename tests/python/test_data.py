# SPDX-License-Identifier: Apache-2.0
"""Data sets as training reads them, and the forms that others read: each against the planes by other code."""

import io
import json
import os
import pickle
import subprocess
import sys
import tarfile
import zlib

import numpy as np
import pytest

import sonocase
from sonocase.data import DataSet, main, write_coco, write_webdataset, write_zarr
from sonocase.domain import DrawnFrames, picture

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
[machine]
model = "paper"
[needle]
share = 0.7
tip_depth_mm = [10, 30]
"""


@pytest.fixture(scope="module")
def made(small, tmp_path_factory):
    from conftest import BIN

    folder = tmp_path_factory.mktemp("data")
    (folder / "small.sonocase").symlink_to(small[0])
    for form in ("png", "npy"):
        recipe = folder / f"{form}.toml"
        recipe.write_text(RECIPE.format(format=form))
        subprocess.run([BIN / "sonoplay", "dataset", recipe, "-o", folder / form, "--frames", "12"], check=True)
    return folder


def test_both_formats_give_the_same_frames(made):
    planes = ("labels", "needle", "shadowed", "skin_depth_mm")
    pictures, arrays = (DataSet(made / form, planes=planes) for form in ("png", "npy"))
    assert len(pictures) == len(arrays) == 12
    assert pictures.classes == arrays.classes == ["outside", "muscle", "vessel"]
    for a, b in zip(pictures, arrays):
        assert a.keys() == b.keys() == {"image", *planes}
        for plane in ("image", "labels", "needle", "shadowed"):
            np.testing.assert_array_equal(a[plane], b[plane])
        # In the picture to 1/100 mm, and what lies before the skin at 0.01 mm: 0 stands for nothing.
        np.testing.assert_allclose(a["skin_depth_mm"], b["skin_depth_mm"].clip(0.01), rtol=0, atol=0.0051)
    assert any((frame["skin_depth_mm"] <= 0).any() for frame in arrays)


def test_what_a_frame_holds_is_the_callers_own(made):
    for form in ("png", "npy"):
        data = DataSet(made / form, planes=("labels", "needle", "shadowed", "skin_depth_mm"))
        frame = data[0]
        for plane in data.planes:
            frame[plane] += 1
        assert all((data[0][plane] != frame[plane]).any() for plane in data.planes)


def test_splits_classes_and_facts(made):
    whole, test = DataSet(made / "png"), DataSet(made / "png", "test", facts=True)
    assert 0 < len(test) < len(whole)
    assert {frame["facts"]["split"] for frame in test} == {"test"}
    one = DataSet(made / "png", classes=["vessel"])
    assert one.classes == DataSet(made / "png", classes=("outside", "vessel")).classes == ["outside", "vessel"]
    for frame, all_classes in zip(one, whole):
        np.testing.assert_array_equal(frame["labels"], all_classes["labels"] == 2)
    assert pickle.loads(pickle.dumps(one)).classes == one.classes  # as a loader's workers get it


def test_a_split_without_frames_is_said(made):
    for split in ("val", "Train", "", 3):
        with pytest.raises(ValueError, match="split: no split .*: give one of train, validate, test"):
            DataSet(made / "png", split)
    with pytest.raises(sonocase.Error, match="no frames of the split validate: there are train, test"):
        DataSet(made / "png", "validate")


@pytest.mark.parametrize("classes, words", [
    ("vessel", "'vessel' is no list"), (["vessl"], "no case has a label vessl: did you mean vessel"), (["vessel", "vessel"], "vessel is there twice"),
    (["zzz"], "no case has a label zzz: expected some of muscle, vessel"), (["vessel", "outside"], "outside is not the first"), ([3], "no case has a label 3"),
    (3, "3 is no list")])
def test_classes_that_no_case_has_are_refused(made, small, classes, words):
    for make in (lambda: DataSet(made / "png", classes=classes), lambda: DrawnFrames(small[0], {}, classes=classes)):
        with pytest.raises(ValueError, match=f"classes: .*{words}"):
            make()


@pytest.mark.parametrize("planes, words", [("labels", "'labels' is no list"), (None, "None is no list"), (["label"], "unknown plane 'label'")])
def test_planes_are_a_list_of_names(made, small, planes, words):
    for make in (lambda: DataSet(made / "png", planes=planes), lambda: DrawnFrames(small[0], {}, planes=planes)):
        with pytest.raises(ValueError, match=words):
            make()


def in_classes_or_outside(facts, classes):
    """The numbers of what a frame shows and of what the tip is in, beside the names; how many were seen."""
    truth = facts["truth"]
    numbers = [(v["index"], v["name"]) for v in truth["visible"]]
    if truth.get("tip"):
        numbers.append((truth["tip"]["label"], truth["tip"]["name"]))
    for number, name in numbers:
        assert classes[number] == name if name in classes else number == 0
    return len(numbers)


@pytest.mark.parametrize("classes", [None, ["vessel"], ["vessel", "muscle"]])
def test_the_numbers_of_facts_are_those_of_the_classes(made, small, tmp_path, classes):
    """The palette is outside, muscle, vessel: of the classes given, none has that order."""
    lines = (made / "png" / "manifest.jsonl").read_text()
    data = DataSet(made / "png", facts=True, classes=classes)
    drawn = DrawnFrames(small[0], DOMAIN, seed=7, count=4, size=(64, 48), facts=True, classes=classes)
    for n, frames in enumerate((data, drawn)):
        numbers = sum(in_classes_or_outside(frame["facts"], frames.classes) for frame in frames)
        assert numbers > 2 * len(frames)
        for frame in frames:  # and what is visible is in the plane of labels
            seen = {v["index"] for v in frame["facts"]["truth"]["visible"]}
            assert set(np.unique(frame["labels"])) - {0} == seen - {0}
        write_zarr(frames, tmp_path / f"{n}.zarr")
        write_webdataset(frames, tmp_path / f"{n}-%d.tar")
        exported = list(map(json.loads, (tmp_path / f"{n}.zarr" / "manifest.jsonl").read_text().splitlines()))
        with tarfile.open(tmp_path / f"{n}-0.tar") as tar:
            exported += [json.load(tar.extractfile(m)) for m in tar if m.name.endswith(".json")]
        assert sum(in_classes_or_outside(record, frames.classes) for record in exported) == 2 * numbers
    assert (made / "png" / "manifest.jsonl").read_text() == lines


def test_a_slice_is_a_list_of_frames(made, small):
    drawn = DrawnFrames(small[0], DOMAIN, seed=7, count=5, size=(16, 16))
    for frames in (DataSet(made / "png"), drawn):
        for part in (slice(1, 3), slice(None, None, 2), slice(-2, None), slice(4, 1), slice(3, 100)):
            wanted = list(range(len(frames)))[part]
            assert [f["image"].tobytes() for f in frames[part]] == [frames[n]["image"].tobytes() for n in wanted]
            assert [r["index"] for r in frames.records[part]] == [frames.records[n]["index"] for n in wanted]
        assert frames[np.int64(1)]["image"].tobytes() == frames[1]["image"].tobytes()
        for bad, kind in (("a", TypeError), (1.5, TypeError), (100, IndexError)):
            with pytest.raises(kind):
                frames[bad]


def test_frames_are_found_from_any_folder(made, small, tmp_path, monkeypatch):
    monkeypatch.chdir(made)
    (tmp_path / "mine.toml").write_text('[machine]\nbase = "modern"\n')
    description = {"model": "physical", "machine": os.path.relpath(tmp_path / "mine.toml", made)}
    frames = [DataSet("png"), DrawnFrames("small.sonocase", description, seed=7, count=3, size=(16, 16), facts=True)]
    expected = [f[2]["image"].tobytes() for f in frames]
    record = json.loads(json.dumps(frames[1].records[2]))
    sent = pickle.dumps(frames)
    monkeypatch.chdir(tmp_path)
    assert [f[2]["image"].tobytes() for f in frames] == [f[2]["image"].tobytes() for f in pickle.loads(sent)] == expected
    assert os.path.isabs(record["case"]) and picture(record).tobytes() == expected[1]


def test_the_record_says_how_large_a_pixel_is(made, case):
    for record in DataSet(made / "png").records:
        exercise = case.exercise(record["exercise"])
        probe = exercise.probe
        probe.depth_mm = record["depth_mm"]
        renderer = sonocase.Renderer(case, exercise, probe=probe, model="paper", size=(64, 48))
        assert record["mm_per_px"] == renderer.mm_per_px
        assert tuple(record["origin_px"]) == tuple(renderer.origin_px)
        assert record["probe"]["shape"] == probe.shape


def test_coco_masks_are_the_planes(made, tmp_path):
    data = DataSet(made / "png")
    write_coco(data, tmp_path / "coco.json")
    coco = json.loads((tmp_path / "coco.json").read_text())
    assert [c["name"] for c in coco["categories"]] == ["muscle", "vessel", "needle", "lesion"]
    drawn = {i["id"]: np.zeros((48, 64), int) for i in coco["images"]}
    needles = {i["id"]: np.zeros((48, 64), bool) for i in coco["images"]}
    for a in coco["annotations"]:
        mask, value = [], 0
        for count in a["segmentation"]["counts"]:
            mask += [value] * count
            value = 1 - value
        mask = np.array(mask, bool).reshape(64, 48).T
        x, y, w, h = a["bbox"]
        assert mask.sum() == a["area"] == mask[y:y + h, x:x + w].sum()
        assert mask[y].any() and mask[y + h - 1].any() and mask[:, x].any() and mask[:, x + w - 1].any()
        if a["category_id"] == 3:
            needles[a["image_id"]] |= mask
        else:
            drawn[a["image_id"]] += a["category_id"] * mask
    for record, frame in zip(data.records, data):
        np.testing.assert_array_equal(drawn[record["index"]], frame["labels"])
        np.testing.assert_array_equal(needles[record["index"]], frame["needle"] > 0)
    assert any(mask.any() for mask in needles.values())


def test_lesions_are_in_every_form(with_cyst, tmp_path):
    from conftest import BIN

    recipe = tmp_path / "cyst.toml"
    recipe.write_text('name = "cyst"\nsize = [64, 48]\n[machine]\nmodel = "physical"\n[[cases]]\n'
                      f'bundle = "{with_cyst}"\nexercises = ["cyst"]\n'
                      "[poses]\nslide_mm = 3\ntilt_deg = 1\nrock_deg = 1\nrotate_deg = 1\n")
    subprocess.run([BIN / "sonoplay", "dataset", recipe, "-o", tmp_path / "set", "--frames", "60"], check=True)
    data = DataSet(tmp_path / "set", planes=("lesions",), facts=True)
    shown = {r["index"]: frame["lesions"] == 1 for r, frame in zip(data.records, data)}
    assert any(mask.sum() > 5 for mask in shown.values())
    assert main(["coco", str(tmp_path / "set"), "-o", str(tmp_path / "coco.json")]) == 0
    coco = json.loads((tmp_path / "coco.json").read_text())
    lesions = [a for a in coco["annotations"] if "attributes" in a]
    assert {a["image_id"]: a["area"] for a in lesions} == {n: m.sum() for n, m in shown.items() if m.any()}
    assert all(a["attributes"] == {"name": "vessel", "kind": "cyst"} for a in lesions)
    assert main(["zarr", str(tmp_path / "set"), "-o", str(tmp_path / "set.zarr")]) == 0
    assert (tmp_path / "set.zarr" / "lesions" / ".zarray").exists()
    for file in (tmp_path / "set" / "frames").glob("lesions_*"):  # as written before there were any
        file.unlink()
    assert main(["coco", str(tmp_path / "set"), "-o", str(tmp_path / "old.json")]) == 0
    assert main(["webdataset", str(tmp_path / "set"), "-o", str(tmp_path / "old-%d.tar")]) == 0


def test_webdataset_holds_the_frames_and_is_the_same_bytes(made, tmp_path):
    data = DataSet(made / "npy")
    for run in "ab":
        write_webdataset(data, str(tmp_path / run / "try-%03d.tar"), 5)
    files = sorted(p.name for p in (tmp_path / "a").iterdir())
    assert files == ["try-000.tar", "try-001.tar", "try-002.tar"]
    seen = 0
    for name in files:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
        with tarfile.open(tmp_path / "a" / name) as tar:
            content = {m.name: tar.extractfile(m).read() for m in tar}
        for key in sorted({n.split(".")[0] for n in content}):
            facts = json.loads(content[f"{key}.json"])
            frame = data[facts["index"]]
            for plane in ("image", "labels", "needle"):
                np.testing.assert_array_equal(np.load(io.BytesIO(content[f"{key}.{plane}.npy"])), frame[plane])
            seen += 1
    assert seen == 12


def test_shards_of_another_run_are_not_mixed_with_new_ones(made, tmp_path):
    data = DataSet(made / "npy")
    for pattern in (tmp_path / "x-%03d.tar", tmp_path / "100%" / "x-%06d.tar", tmp_path / "n%d" / "x.tar", tmp_path / "%%-%4d.tar"):
        write_webdataset(data, pattern, 5)
        written = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*.tar"))
        assert len(written) == 3 and not list(tmp_path.rglob("*.part"))
        for frames in (3, 5, 100):
            with pytest.raises(sonocase.Error, match="is there already: remove the shards"):
                write_webdataset(data, pattern, frames)
        assert written == sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*.tar"))
        for path in tmp_path.rglob("*.tar"):
            path.unlink()
    assert (tmp_path / "100%").is_dir() and (tmp_path / "n2").is_dir()
    (tmp_path / "x-000.tar.part").touch()  # of a run that was stopped, and of another pattern
    (tmp_path / "x-y.tar").touch()
    write_webdataset(data, tmp_path / "x-%03d.tar")
    assert {p.name for p in tmp_path.iterdir() if p.is_file()} == {"x-000.tar", "x-y.tar"}


def test_a_run_that_fails_leaves_no_shards(made, tmp_path):
    data = DataSet(made / "npy")
    data.records[-1] = {**data.records[-1], "chunk": 99}
    with pytest.raises(sonocase.Error, match="no such file"):
        write_webdataset(data, tmp_path / "x-%d.tar", 2)
    assert not list(tmp_path.iterdir())


def read_zarr(folder, name):
    """An array by the rules of Zarr's version 2: whole chunks, the rest beyond the shape cut off."""
    assert json.loads((folder / ".zgroup").read_text()) == {"zarr_format": 2}
    about = json.loads((folder / name / ".zarray").read_text())
    assert set(about) == {"zarr_format", "shape", "chunks", "dtype", "compressor", "fill_value", "order", "filters"}
    assert about["zarr_format"] == 2 and about["order"] == "C" and about["filters"] is None
    shape, chunks = about["shape"], about["chunks"]
    whole = np.full(shape, float(about["fill_value"]), about["dtype"])
    for at in np.ndindex(*[-(-s // c) for s, c in zip(shape, chunks)]):
        content = (folder / name / ".".join(map(str, at))).read_bytes()
        if about["compressor"] is not None:
            assert about["compressor"]["id"] == "zlib"
            content = zlib.decompress(content)
        chunk = np.frombuffer(content, about["dtype"]).reshape(chunks)
        place = tuple(slice(a * c, min((a + 1) * c, s)) for a, c, s in zip(at, chunks, shape))
        whole[place] = chunk[tuple(slice(0, p.stop - p.start) for p in place)]
        beyond = np.ones(chunks, bool)
        beyond[tuple(slice(0, p.stop - p.start) for p in place)] = False
        assert np.array_equal(chunk[beyond], np.full(beyond.sum(), float(about["fill_value"])), equal_nan=True)
    files = {p.name for p in (folder / name).iterdir()} - {".zarray", ".zattrs"}
    assert len(files) == -(-shape[0] // chunks[0])
    return whole


@pytest.mark.parametrize("compress", [True, False])
def test_zarr_holds_the_frames_and_is_the_same_bytes(made, tmp_path, compress):
    planes = ("labels", "needle", "skin_depth_mm")
    data = DataSet(made / "npy", planes=planes)
    for run in "ab":
        write_zarr(data, tmp_path / run, 5, compress)
    written = {p.relative_to(tmp_path / "a"): p.read_bytes() for p in (tmp_path / "a").rglob("*") if p.is_file()}
    assert written == {p.relative_to(tmp_path / "b"): p.read_bytes()
                       for p in (tmp_path / "b").rglob("*") if p.is_file()}
    for plane in data.planes:
        expected = np.stack([frame[plane] for frame in data])
        found = read_zarr(tmp_path / "a", plane)
        assert found.dtype == expected.dtype
        fill = json.loads((tmp_path / "a" / plane / ".zarray").read_text())["fill_value"]
        assert fill == ("NaN" if plane == "skin_depth_mm" else 0)
        np.testing.assert_array_equal(found, expected)
    assert read_zarr(tmp_path / "a", "index").tolist() == [r["index"] for r in data.records]
    assert json.loads((tmp_path / "a" / ".zattrs").read_text())["classes"] == data.classes
    together = json.loads((tmp_path / "a" / ".zmetadata").read_text())["metadata"]
    assert set(together) == {str(p) for p in written if p.name.startswith(".")} - {".zmetadata"}
    assert together["labels/.zarray"] == json.loads((tmp_path / "a" / "labels" / ".zarray").read_text())
    assert list(map(json.loads, (tmp_path / "a" / "manifest.jsonl").read_text().splitlines())) == data.records
    with pytest.raises(sonocase.Error, match="there already"):
        write_zarr(data, tmp_path / "a")


DOMAIN = {
    "chunk": 2, "model": "physical", "gain_db": [-6, 6],
    "machine": {"base": ["modern", "classic"], "grey": {"level": [40, 70]}, "looks": {"count": [1, 3]},
                "tissue_db": {"muscle": [-4, 4]}},
    "probe": {"depth_mm": {"one_of": [60, 90]}, "frequency_mhz": [2.5, 5]},
    "pose": {"press_mm": [0, 4]},
    "dynamic_range_db": [50, 70],
    "needle": {"share": 0.5, "tip_depth_mm": [10, 30], "tent_mm": [0, 2], "gauge": [18, 22],
               "make": ["chiba", "notched"]}}


def test_a_sample_is_the_same_in_any_order_and_process(small):
    frames = DrawnFrames(small[0], DOMAIN, seed=7, count=12, size=(64, 48), facts=True)
    pictures = [frame["image"] for frame in frames]
    records = [json.loads(json.dumps(r)) for r in frames.records]
    other = pickle.loads(pickle.dumps(frames))  # as a loader's workers get it
    for i in (11, 0, 7, 3):
        again = other[i]
        np.testing.assert_array_equal(again["image"], pictures[i])
        assert {k: v for k, v in again["facts"].items() if k != "truth"} == records[i]
        np.testing.assert_array_equal(picture(records[i]), pictures[i])  # of its record alone
    program = ("import json, sys; from sonocase.domain import DrawnFrames; "
               "print(json.dumps(DrawnFrames(sys.argv[1], json.loads(sys.argv[2]), 7, 8, size=(64, 48)).records[7]))")
    apart = subprocess.run([sys.executable, "-c", program, small[0], json.dumps(DOMAIN)],
                           check=True, capture_output=True, text=True)
    assert json.loads(apart.stdout) == records[7]
    more = DrawnFrames(small[0], {**DOMAIN, "pose": {**DOMAIN["pose"], "time_s": 1}}, seed=7, count=20, size=(64, 48))
    assert more.records[5]["gain_db"] == records[5]["gain_db"] and more.records[5]["time_s"] == 1
    assert DrawnFrames(small[0], DOMAIN, seed=8, size=(64, 48)).records[5]["gain_db"] != records[5]["gain_db"]


def test_draws_fill_their_ranges(small):
    records = list(DrawnFrames(small[0], DOMAIN, seed=7, count=60, size=(16, 16)).records)
    gains = np.array([r["gain_db"] for r in records])
    # The outermost of 60 draws are further than a tenth from an end with 4 seeds in 1,000.
    assert -6 <= gains.min() < -4.8 and 4.8 < gains.max() <= 6
    # Four standard deviations of the mean of 60.
    assert abs(gains.mean()) < 4 * 12 / np.sqrt(12 * 60)
    assert {r["machine"]["looks"]["count"] for r in records} == {1, 2, 3}
    assert {(r["machine"]["base"], r["probe"]["depth_mm"]) for r in records} == \
        {(base, depth) for base in ("modern", "classic") for depth in (60, 90)}
    assert all(a["machine"] == b["machine"] for a, b in zip(records[::2], records[1::2]))
    assert {r["needle"]["make"] for r in records} == {"chiba", "notched"}
    assert all(18 <= r["needle"]["gauge"] <= 22 and 50 <= r["dynamic_range_db"] <= 70 for r in records)
    assert 15 < sum(r["mannequin_from_needle"] is not None for r in records) < 45
    assert all((r["mannequin_from_needle"] is None) == (r["dent_mm"] is None) for r in records)


def test_what_is_drawn_reaches_the_picture(small):
    """Each key by itself, from one end to the other; in the physical model, which has all of them."""
    still = {"model": "physical", "chunk": 1, "pose": {"slide_mm": 0, "tilt_deg": 0, "rock_deg": 0, "rotate_deg": 0},
             "needle": {"share": 1, "tip_depth_mm": 25}}

    def drawn(change):
        return DrawnFrames(small[0], {**still, **change}, count=1, size=(48, 48), planes=())[0]["image"]

    standard = drawn({})
    for change in ({"gain_db": 6}, {"machine": {"grey": {"exponent": 0.5}}}, {"machine": {"tissue_db": {"muscle": 4}}},
                   {"machine": {"gain": {"tgc_db_per_cm_mhz": 0.9}}}, {"probe": {"frequency_mhz": 7}},
                   {"probe": {"elevation_mm": 8}}, {"pose": {**still["pose"], "press_mm": 10}},
                   {"pose": {**still["pose"], "tilt_deg": 20}}, {"needle": {**still["needle"], "share": 0}},
                   {"needle": {**still["needle"], "tent_mm": 6}}, {"needle": {**still["needle"], "gauge": 10}},
                   {"needle": {**still["needle"], "make": "notched"}}, {"dynamic_range_db": 40}):
        assert (drawn(change) != standard).any(), change
    # A machine's knob of contrast acts where its map is logarithmic.
    narrow, wide = (drawn({"machine": {"grey": {"map": "log", "dynamic_range_db": v}}}) for v in (40, 80))
    assert (narrow != wide).any()


def test_drawn_frames_go_into_the_writers(small, tmp_path):
    frames = DrawnFrames(small[0], DOMAIN, seed=7, count=4, size=(64, 48), facts=True)
    write_zarr(frames, tmp_path / "a.zarr", 3)
    write_webdataset(frames, tmp_path / "a-%02d.tar")
    with pytest.raises(sonocase.Error, match="picture files"):
        write_coco(frames, tmp_path / "a.json")
    np.testing.assert_array_equal(read_zarr(tmp_path / "a.zarr", "image"), [f["image"] for f in frames])
    records = list(map(json.loads, (tmp_path / "a.zarr" / "manifest.jsonl").read_text().splitlines()))
    np.testing.assert_array_equal(picture(records[2]), frames[2]["image"])
    assert records[2]["truth"]["contact"] > 0
    with tarfile.open(tmp_path / "a-00.tar") as tar:
        assert json.load(tar.extractfile("00000002.json")) == {**records[2], "classes": frames.classes}


@pytest.mark.parametrize("change, words", [
    ({"gain_db": [6, -6]}, "gain_db: .*reversed"), ({"gain_db": [0, 100]}, "gain_db: .*-60 to 60"),
    ({"gain_db": [1, 2, 3]}, "gain_db: .*no range"), ({"gain_db": "loud"}, "gain_db: .*not a number"),
    ({"gain_db": [0, float("nan")]}, "gain_db: .*finite"), ({"gain": 3}, "gain: .*gain_db"),
    ({"gain_db": {"one_of": []}}, "gain_db: .*empty"), ({"chunk": 0}, "chunk: 0"),
    ({"pose": {"press_mm": [-1, 2]}}, "pose.press_mm: .*0 to 40"), ({"pose": {"tilt": 3}}, "pose.tilt: .*tilt_deg"),
    ({"needle": {"share": 2}}, "needle.share: "), ({"needle": {"gauge": 3}}, "needle.gauge: .*6 to 34"),
    ({"needle": {"make": ["chiba", "gold"]}}, "needle.make: no make gold"), ({"needle": {"make": [1, 2]}}, "needle.make: "),
    ({"dynamic_range_db": 10}, "dynamic_range_db: .*20 to 120"),
    ({"dynamic_range_db": 50, "model": "paper"}, "dynamic_range_db: changes nothing"), ({"needle": 3}, "needle: "),
    ({"probe": {"depth_mm": [-5, 60]}}, "probe.depth_mm: "), ({"exercises": ["scam"]}, "scam"),
    ({"machine": {"grey": {"level": [40, 400]}}}, "machine.grey.level is 400"),
    ({"machine": {"grey": {"levle": 40}}}, "levle.*level"), ({"machine": "toaster"}, "toaster"),
    ({"machine": {"looks": {"count": [1, 2.5]}}}, "machine.looks.count: .*whole"),
    ({"machine": {"persistence": [[1], [2]]}}, "machine.persistence: "),
    ({"machine": {"grey": {"level": None}}}, "machine.grey.level: null"),
    ({"machine": {"tissue_db": {"vesel": 3}}}, "tissue_db.vesel: .*vessel"),
    ({"machine": {"grey": {"dynamic_range_db": [40, 80]}}}, "dynamic_range_db: changes nothing"),
    ({"machine": "classic", "model": "paper"}, "machine: changes nothing")])
def test_a_bad_range_is_one_sentence_that_names_its_key(small, change, words):
    with pytest.raises((ValueError, sonocase.Error), match=words) as raised:
        DrawnFrames(small[0], {"model": "physical", **change})
    assert "\n" not in str(raised.value)


def test_numbers_of_numpy_are_numbers(small):
    own = {"gain_db": [-6, 6], "pose": {"press_mm": 3.0}, "needle": {"share": {"one_of": [0.0, 1.0]}}, "chunk": 2}
    numpys = {"gain_db": np.array([-6, 6]), "pose": {"press_mm": np.float64(3)},
              "needle": {"share": {"one_of": np.array([0.0, 1.0])}}, "chunk": np.int64(2)}
    a, b = (DrawnFrames(small[0], d, seed=np.int64(7), count=np.int32(4), size=np.array([16, 16])) for d in (own, numpys))
    assert json.dumps(list(a.records)) == json.dumps(list(b.records))
    for bad, words in (({"seed": 1.9}, "seed: 1.9 is no whole"), ({"count": "3"}, "count: '3'"), ({"size": 64}, "size: 64 is no size")):
        with pytest.raises(ValueError, match=words):
            DrawnFrames(small[0], {}, **bad)
    with pytest.raises(ValueError, match="pose.press_mm: of type object"):
        DrawnFrames(small[0], {"pose": {"press_mm": object()}})


@pytest.mark.parametrize("arguments, words", [
    (["coco", "none", "-o", "x.json"], "dataset.json"), (["coco", "npy", "-o", "x.json"], "png"),
    (["webdataset", "npy", "-o", "x.tar"], "number"), (["webdataset", "npy", "-o", "x-%d-%d.tar"], "one number"),
    (["webdataset", "npy", "-o", "x-%%06d.tar"], "one number"), (["webdataset", "npy", "-o", "."], "one number"),
    (["webdataset", "npy", "-o", "x-%d.tar", "--frames-per-shard", "0"], "frames_per_shard: 0"),
    (["webdataset", "npy", "-o", "x-%d.tar", "--split", "validate"], "no frames"),
    (["coco", "png", "-o", "."], "is a folder"), (["zarr", "png", "-o", "."], "there already"),
    (["zarr", "npy", "-o", "npy"], "there already"),
    (["zarr", "npy", "-o", "x.zarr", "--split", "validate"], "no frames"),
    (["zarr", "npy", "-o", "x.zarr", "--frames-per-chunk", "0"], "frames_per_chunk")])
def test_what_cannot_be_done_is_one_line(made, tmp_path, capsys, monkeypatch, arguments, words):
    monkeypatch.chdir(made)
    assert main(arguments) == 1
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1
    assert not list(made.glob("x.*"))


def test_a_class_list_is_kept_by_both_writers(made, tmp_path, monkeypatch):
    monkeypatch.chdir(made)
    assert main(["coco", "png", "-o", str(tmp_path / "new" / "c.json"), "--split", "test"]) == 0
    assert {i["id"] for i in json.loads((tmp_path / "new" / "c.json").read_text())["images"]} == \
        {r["index"] for r in DataSet("png", "test").records}
