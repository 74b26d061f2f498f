# SPDX-License-Identifier: Apache-2.0
"""Data sets as training reads them, and the forms that others read: each against the planes by other code."""

import io
import json
import pickle
import subprocess
import tarfile
import zlib

import numpy as np
import pytest

import sonocase
from sonocase.data import DataSet, main, write_coco, write_webdataset, write_zarr

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
        # In the picture to 1/100 mm, and 0 stands for nothing and for what lies before the skin.
        np.testing.assert_allclose(np.nan_to_num(a["skin_depth_mm"]), np.nan_to_num(b["skin_depth_mm"]).clip(0),
                                   rtol=0, atol=0.0051)


def test_splits_classes_and_facts(made):
    whole, test = DataSet(made / "png"), DataSet(made / "png", "test", facts=True)
    assert 0 < len(test) < len(whole) and len(DataSet(made / "png", "validate")) == 0
    assert {frame["facts"]["split"] for frame in test} == {"test"}
    one = DataSet(made / "png", classes=["rest", "vessel"])
    for frame, all_classes in zip(one, whole):
        np.testing.assert_array_equal(frame["labels"], all_classes["labels"] == 2)
    assert pickle.loads(pickle.dumps(one)).classes == one.classes  # as a loader's workers get it


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
    assert [c["name"] for c in coco["categories"]] == ["muscle", "vessel", "needle"]
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


@pytest.mark.parametrize("arguments, words", [
    (["coco", "none", "-o", "x.json"], "dataset.json"), (["coco", "npy", "-o", "x.json"], "png"),
    (["webdataset", "npy", "-o", "x.tar"], "number"), (["zarr", "npy", "-o", "npy"], "there already"),
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
    assert main(["coco", "png", "-o", str(tmp_path / "c.json"), "--split", "test"]) == 0
    assert {i["id"] for i in json.loads((tmp_path / "c.json").read_text())["images"]} == \
        {r["index"] for r in DataSet("png", "test").records}
