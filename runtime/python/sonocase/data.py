# SPDX-License-Identifier: Apache-2.0
"""Reads what `sonoplay dataset` wrote, for training, and writes it in forms that others read.

    from sonocase.data import DataSet
    data = DataSet("abdomen", split="train", planes=("labels", "needle"))
    frame = data[0]                 # {"image": uint8 (height, width), "labels": ..., "needle": ...}
    loader = torch.utils.data.DataLoader(data, batch_size=32, shuffle=True, num_workers=2)

A DataSet has len() and [i], which is all that torch asks of a data set; torch itself is not needed.

    python3 -m sonocase.data coco abdomen -o abdomen.json
    python3 -m sonocase.data webdataset abdomen -o shards/abdomen-%06d.tar
    python3 -m sonocase.data zarr abdomen -o abdomen.zarr
"""

import argparse
import difflib
import glob
import io
import json
import os
import pathlib
import re
import shutil
import sys
import tarfile
import zlib

import numpy as np

from . import Error

# Name in a frame, of the picture's file, and of the array's file.
_PLANES = {"image": ("image", "images"), "labels": ("labels", "labels"),
           "needle": ("needle", "needle"), "shadowed": ("shadow", "shadow"),
           "skin_depth_mm": ("depth", "depth"), "lesions": ("lesions", "lesions")}
SPLITS = ("train", "validate", "test")


def _read(path):
    if not path.exists():
        raise Error(f"no such file: {path}: run sonoplay dataset again, it goes on where it stopped")
    return path


def _names(given, argument):
    """A list of names; text alone, whose letters would be the names, is none."""
    if isinstance(given, (str, bytes)) or not hasattr(given, "__iter__"):
        raise ValueError(f"{argument}: {given!r} is no list: give names in a list, as [\"labels\"]")
    return list(given)


def checked_planes(planes, known):
    """Names of a frame's planes, "image" first. Raises ValueError for others than `known`."""
    planes = _names(planes, "planes")
    for plane in planes:
        if plane not in known and plane != "image":
            raise ValueError(f"unknown plane '{plane}': expected some of {', '.join(known)}")
    return ("image", *[p for p in planes if p != "image"])


def _checked_classes(classes, known):
    classes = _names(classes, "classes")
    for name in classes:
        if name != "outside" and name not in known:
            near = difflib.get_close_matches(str(name), known, 1, 0.5)
            raise ValueError(f"classes: no case has a label {name}: " +
                             (f"did you mean {near[0]}?" if near else f"expected some of {', '.join(sorted(known))}"))
        if classes.count(name) > 1:
            raise ValueError(f"classes: {name} is there twice: give each name once")
    if "outside" in classes[1:]:
        raise ValueError("classes: outside is not the first: give it first, or leave it out")
    return classes if classes[:1] == ["outside"] else ["outside", *classes]


def common_classes(palettes, classes=None):
    """Classes of several cases, and by case an array from its own label to its class.

    palettes   by case, the names of its labels, "outside" first
    classes    names; by default all of them, by the alphabet. "outside" comes first, also where it
               is not given
    """
    names = {n for palette in palettes.values() for n in palette[1:]}
    classes = ["outside", *sorted(names)] if classes is None else _checked_classes(classes, names)
    index = {name: i for i, name in enumerate(classes)}
    kind = np.uint8 if len(classes) <= 256 else np.uint16
    return classes, {case: np.array([index.get(n, 0) for n in palette], kind)
                     for case, palette in palettes.items()}


def facts_in_classes(truth, class_of):
    """A frame's truth with classes for labels: `index` of what is visible, and `label` of the tip.

    What is not among the classes keeps its name and has the index 0.
    """
    if "visible" not in truth:  # of a frame without a pose
        return truth
    truth = {**truth, "visible": [{**v, "index": int(class_of[v["index"]])} for v in truth["visible"]]}
    if truth.get("tip"):
        truth["tip"] = {**truth["tip"], "label": int(class_of[truth["tip"]["label"]])}
    return truth


def in_classes(labels, class_of):
    """A plane of labels as classes, by an array of common_classes()."""
    if labels.dtype != np.uint8 or class_of.dtype != np.uint8:
        return class_of[labels]
    table = class_of.tobytes().ljust(256, b"\0")  # a quarter of the time of an index by an array
    return np.frombuffer(bytearray(np.ascontiguousarray(labels)).translate(table), np.uint8).reshape(labels.shape)


class DataSet:
    """The frames of a data set, in the order of their numbers.

    folder   that sonoplay dataset wrote
    split    "train", "validate" or "test"; all by default
    planes   what a frame holds beside "image": labels, needle, shadowed, skin_depth_mm
    facts    also "facts": the frame's record, a dict that torch cannot stack
    classes  names; by default those of all cases, by the alphabet. "outside" comes first, also where
             it is not given

    "labels" of a frame are indices into `classes`, the same for all cases, whose own palettes
    differ. A label that is not among the classes given becomes 0. `records` are the lines of
    manifest.jsonl with these indices: in `visible` and `tip` of a frame's truth, too.
    """

    def __init__(self, folder, split=None, planes=("labels", "needle"), facts=False, classes=None):
        self.folder = pathlib.Path(os.path.abspath(os.fsdecode(folder)))
        self.planes = checked_planes(planes, _PLANES)
        if split is not None and split not in SPLITS:
            raise ValueError(f"split: no split {split}: give one of {', '.join(SPLITS)}")
        self.description = json.loads(_read(self.folder / "dataset.json").read_text("utf-8"))
        palettes = {c["bundle"]: [l["name"] for l in c["labels"]]
                    for c in self.description["cases"]}
        self.classes, self._class_of = common_classes(palettes, classes)
        lines = _read(self.folder / "manifest.jsonl").read_text("utf-8").splitlines()
        records = list(map(json.loads, lines))
        self.records = [r for r in records if split in (None, r["split"])]
        if not self.records:
            there = [s for s in SPLITS if any(r["split"] == s for r in records)]
            raise Error(f"{self.folder}: no frames" + (f" of the split {split}: there are {', '.join(there)}"
                                                       if there else ": run sonoplay dataset again"))
        for record in self.records:
            if "truth" in record:
                record["truth"] = facts_in_classes(record["truth"], self._class_of[record["case"]])
        self.facts = facts
        self._arrays = {}

    def __len__(self):
        """Frames."""
        return len(self.records)

    def __iter__(self):
        return map(self.__getitem__, range(len(self)))

    def __getstate__(self):  # workers open their own files
        return {**self.__dict__, "_arrays": {}}

    def __getitem__(self, i):
        """One frame, a dict of arrays; of a slice a list of them."""
        if isinstance(i, slice):
            return [self[n] for n in range(len(self))[i]]
        record = self.records[i]
        frame = {plane: self._plane(record, plane) for plane in self.planes}
        if "labels" in frame:
            frame["labels"] = in_classes(frame["labels"], self._class_of[record["case"]])
        if self.facts:
            frame["facts"] = record
        return frame

    def has(self, plane):
        """Whether the files of a plane are there: data sets of before plane `lesions` lack it."""
        picture, array = _PLANES[plane]
        first = self.records[0]
        if "image" in first:
            return (self.folder / "frames" / f"{picture}_{first['index']:08d}.png").exists()
        return (self.folder / "arrays" / f"{array}_{first['chunk']:06d}.npy").exists()

    def _plane(self, record, plane):
        picture, array = _PLANES[plane]
        if "image" in record:
            from PIL import Image  # where it is missing, ask for format = "npy"

            path = self.folder / "frames" / f"{picture}_{record['index']:08d}.png"
            values = np.array(Image.open(_read(path)))  # the caller's own, to be changed
            if plane == "skin_depth_mm":
                values = np.where(values == 0, np.nan, values / 100).astype(np.float32)
            return values
        name = f"{array}_{record['chunk']:06d}.npy"
        if name not in self._arrays:
            self._arrays = {k: v for k, v in list(self._arrays.items())[-9:]}
            self._arrays[name] = np.load(_read(self.folder / "arrays" / name), mmap_mode="r")
        return np.array(self._arrays[name][record["row"]])


def _runs(mask):
    """Lengths of runs down the columns, of what is not in the mask first: COCO's counts."""
    line = mask.T.ravel()
    ends = np.flatnonzero(np.diff(line)) + 1
    counts = np.diff(np.concatenate(([0], ends, [line.size]))).tolist()
    return [0, *counts] if line[0] else counts


def write_coco(data, path):
    """Writes annotations in COCO's form: a mask of each class, of the needle and of each lesion in each picture.

    Masks are run lengths (pycocotools reads them); file names are relative to the data set's folder. Lesions are of one
    category, whatever their name and kind, which are the annotation's `attributes`.
    """
    if data.records and "image" not in data.records[0]:
        where = getattr(data, "folder", "frames that are drawn")
        raise Error(f"{where}: COCO names picture files: ask sonoplay dataset for format = \"png\"")
    path = pathlib.Path(path)
    if path.is_dir():
        raise Error(f"{path}: is a folder: give the name of a file, as {path / 'abdomen.json'}")
    categories = [{"id": i, "name": n} for i, n in enumerate(data.classes) if i > 0]
    needle = len(data.classes)
    categories += [{"id": needle, "name": "needle"}, {"id": needle + 1, "name": "lesion"}]
    images, annotations = [], []
    drawn = data.has("lesions")
    whole = DataSet(data.folder, None, ("labels", "needle", *(["lesions"] if drawn else [])), classes=data.classes)
    whole.records = data.records
    for record, frame in zip(data.records, whole):
        height, width = frame["image"].shape
        images.append({"id": record["index"], "file_name": record["image"], "width": width,
                       "height": height, "mm_per_px": record.get("mm_per_px")})
        masks = [(int(c), frame["labels"] == c, {}) for c in np.unique(frame["labels"]) if c > 0]
        masks.append((needle, frame["needle"] > 0, {}))
        for lesion in record["truth"]["lesions"] if drawn else []:
            more = {"attributes": {"name": lesion["name"], "kind": lesion["kind"]}}
            masks.append((needle + 1, frame["lesions"] == lesion["index"], more))
        for category, mask, more in masks:
            rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
            if not rows.size:
                continue
            box = [int(columns[0]), int(rows[0]), int(columns[-1] - columns[0] + 1),
                   int(rows[-1] - rows[0] + 1)]
            annotations.append({"id": len(annotations) + 1, "image_id": record["index"],
                                "category_id": category, "iscrowd": 0, "bbox": box,
                                "area": int(mask.sum()), **more,
                                "segmentation": {"size": [height, width], "counts": _runs(mask)}})
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".part")
    partial.write_text(json.dumps({"images": images, "annotations": annotations,
                                   "categories": categories}))
    partial.replace(path)


def _shard_name(pattern):
    """What stands before a shard's number, how the number is written, and what stands behind it."""
    parts = re.split(r"(%%|%0?\d*d)", os.fsdecode(pattern))  # every second is one of these
    numbers = [i for i in range(1, len(parts), 2) if parts[i] != "%%"]
    if len(numbers) != 1:
        raise ValueError(f"pattern: {pattern}: expected one number in it, as in abdomen-%06d.tar")
    plain = ["%" if part == "%%" else part for part in parts]
    return "".join(plain[:numbers[0]]), parts[numbers[0]], "".join(plain[numbers[0] + 1:])


def write_webdataset(data, pattern, frames_per_shard=1000):
    """Writes tar files as WebDataset reads them: NNNNNNNN.image.npy, .labels.npy, ... and .json.

    pattern   with one number, as in "abdomen-%06d.tar"; the same data give the same bytes. No shard
              of it may be there yet: readers would take those of another run for this one's
    """
    head, number, tail = _shard_name(pattern)
    if frames_per_shard < 1:
        raise ValueError(f"frames_per_shard: {frames_per_shard} is out of range: give 1 or more")
    if not len(data):
        raise Error(f"{pattern}: no frames to write: the data set is empty")
    shard_of_pattern = re.compile(re.escape(head) + r" *\d+" + re.escape(tail))
    for there in sorted(glob.glob(glob.escape(head) + "*" + glob.escape(tail))):
        if shard_of_pattern.fullmatch(there):
            raise Error(f"{there}: is there already: remove the shards, or give another name")

    def add(tar, name, content):
        entry = tarfile.TarInfo(name)
        entry.size = len(content)
        tar.addfile(entry, io.BytesIO(content))

    written = []
    try:
        for shard, first in enumerate(range(0, len(data), frames_per_shard)):
            path = pathlib.Path(head + number % shard + tail)
            path.parent.mkdir(parents=True, exist_ok=True)
            written.append((path.with_name(path.name + ".part"), path))
            with tarfile.open(written[-1][0], "w", format=tarfile.USTAR_FORMAT) as tar:
                for i in range(first, min(first + frames_per_shard, len(data))):
                    frame = data[i]
                    record = frame.get("facts") or data.records[i]
                    key = f"{record['index']:08d}"
                    for plane in data.planes:
                        content = io.BytesIO()
                        np.save(content, frame[plane])
                        add(tar, f"{key}.{plane}.npy", content.getvalue())
                    add(tar, f"{key}.json",
                        json.dumps({**record, "classes": data.classes}).encode())
        for partial, path in written:  # all, or none
            partial.replace(path)
    finally:
        for partial, _ in written:
            partial.unlink(missing_ok=True)


def write_zarr(data, path, frames_per_chunk=16, compress=True):
    """Writes a group in Zarr's version 2: an array (frame, row, column) per plane, and `index`.

    path       of the folder, which must not be there yet; the same data give the same bytes
    compress   zlib, which every reader of Zarr has; False: plain values, to be mapped

    `classes` is among the group's attributes; manifest.jsonl beside the arrays has the records.
    """
    path = pathlib.Path(path)
    if path.exists():
        raise Error(f"{path}: is there already: remove it, or give another name")
    if not len(data):
        raise Error(f"{path}: no frames to write: the data set or the split is empty")
    if frames_per_chunk < 1:
        raise ValueError(f"frames_per_chunk: {frames_per_chunk} is out of range: give 1 or more")
    partial = path.with_name(path.name + ".part")
    if partial.exists():  # of a run that was stopped
        shutil.rmtree(partial)
    partial.mkdir(parents=True)
    about = {".zgroup": {"zarr_format": 2}, ".zattrs": {"classes": data.classes}}

    def describe(name, first, fill, dimensions):
        about[f"{name}/.zarray"] = {
            "zarr_format": 2, "shape": [len(data), *first.shape],
            "chunks": [frames_per_chunk, *first.shape], "dtype": first.dtype.str, "order": "C",
            "compressor": {"id": "zlib", "level": 6} if compress else None,
            "fill_value": fill, "filters": None}
        about[f"{name}/.zattrs"] = {"_ARRAY_DIMENSIONS": dimensions}  # as xarray reads them
        (partial / name).mkdir()

    def write(name, number, rows, fill):
        whole = np.full((frames_per_chunk, *rows[0].shape), fill, rows[0].dtype)
        whole[:len(rows)] = rows  # the last chunk is as large as the others
        content = whole.tobytes()
        chunk = ".".join([str(number), *["0"] * (whole.ndim - 1)])
        (partial / name / chunk).write_bytes(zlib.compress(content, 6) if compress else content)

    with open(partial / "manifest.jsonl", "w", encoding="utf-8") as manifest:
        for number, first in enumerate(range(0, len(data), frames_per_chunk)):
            planes, indices = {plane: [] for plane in data.planes}, []
            for i in range(first, min(first + frames_per_chunk, len(data))):
                frame = data[i]
                record = frame.get("facts") or data.records[i]
                manifest.write(json.dumps(record) + "\n")
                indices.append(np.array(record["index"], "<i8"))
                for plane in data.planes:
                    values = frame[plane]
                    planes[plane].append(values.astype(values.dtype.newbyteorder("<"), copy=False))
            for name, rows in [*planes.items(), ("index", indices)]:
                real = rows[0].dtype.kind == "f"
                if number == 0:
                    describe(name, rows[0], "NaN" if real else 0,
                             ["frame", "row", "column"][:rows[0].ndim + 1])
                write(name, number, rows, np.nan if real else 0)
    about[".zmetadata"] = {"zarr_consolidated_format": 1, "metadata": dict(about)}
    for name, content in about.items():
        (partial / name).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    partial.replace(path)


def main(arguments=None):
    """The command line; returns the exit status. A failure is one line."""
    parser = argparse.ArgumentParser(prog="python3 -m sonocase.data", description=__doc__.split("\n")[0])
    parser.add_argument("form", choices=["coco", "webdataset", "zarr"])
    parser.add_argument("folder", help="that sonoplay dataset wrote")
    parser.add_argument("-o", "--out", required=True,
                        help="coco: a .json file; webdataset: shards, as in abdomen-%%06d.tar; "
                             "zarr: a new folder")
    parser.add_argument("--split", choices=SPLITS)
    parser.add_argument("--frames-per-shard", type=int, default=1000)
    parser.add_argument("--frames-per-chunk", type=int, default=16, help="zarr")
    parser.add_argument("--plain", action="store_true", help="zarr: chunks without compression")
    chosen = parser.parse_args(arguments)
    try:
        data = DataSet(chosen.folder, chosen.split)
        data.planes = tuple(p for p in _PLANES if data.has(p))
        if chosen.form == "coco":
            write_coco(data, chosen.out)
        elif chosen.form == "zarr":
            write_zarr(data, chosen.out, chosen.frames_per_chunk, not chosen.plain)
        else:
            write_webdataset(data, chosen.out, chosen.frames_per_shard)
    except (Error, ValueError, OSError, TypeError) as error:
        print(f"sonocase.data: {error}", file=sys.stderr)
        return 1
    print(f"{len(data)} frames, {len(data.classes)} classes: {chosen.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
