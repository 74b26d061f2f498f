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
import io
import json
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


def _read(path):
    if not path.exists():
        raise Error(f"no such file: {path}: run sonoplay dataset again, it goes on where it stopped")
    return path


def common_classes(palettes, classes=None):
    """Classes of several cases, and by case an array from its own label to its class.

    palettes   by case, the names of its labels, "outside" first
    classes    names; by default all of them, "outside" first, the rest by the alphabet
    """
    if classes is None:
        classes = ["outside", *sorted({n for palette in palettes.values() for n in palette[1:]})]
    index = {name: i for i, name in enumerate(classes)}
    kind = np.uint8 if len(classes) <= 256 else np.uint16
    return list(classes), {case: np.array([index.get(n, 0) for n in palette], kind)
                           for case, palette in palettes.items()}


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
    facts    also "facts": the line of manifest.jsonl, a dict that torch cannot stack
    classes  names; by default those of all cases, "outside" first, the rest by the alphabet

    "labels" of a frame are indices into `classes`, the same for all cases, whose own palettes
    differ. A label that is not among the classes given becomes 0.
    """

    def __init__(self, folder, split=None, planes=("labels", "needle"), facts=False, classes=None):
        self.folder = pathlib.Path(folder)
        for plane in planes:
            if plane not in _PLANES:
                raise ValueError(f"unknown plane '{plane}': expected some of {', '.join(_PLANES)}")
        self.description = json.loads(_read(self.folder / "dataset.json").read_text())
        lines = _read(self.folder / "manifest.jsonl").read_text().splitlines()
        self.records = [r for r in map(json.loads, lines) if split in (None, r["split"])]
        self.planes = ("image", *[p for p in planes if p != "image"])
        self.facts = facts
        palettes = {c["bundle"]: [l["name"] for l in c["labels"]]
                    for c in self.description["cases"]}
        self.classes, self._class_of = common_classes(palettes, classes)
        self._arrays = {}

    def __len__(self):
        return len(self.records)

    def __iter__(self):
        return map(self.__getitem__, range(len(self)))

    def __getstate__(self):  # workers open their own files
        return {**self.__dict__, "_arrays": {}}

    def __getitem__(self, i):
        record = self.records[i]
        frame = {plane: self._plane(record, plane) for plane in self.planes}
        if "labels" in frame:
            frame["labels"] = in_classes(frame["labels"], self._class_of[record["case"]])
        if self.facts:
            frame["facts"] = record
        return frame

    def _plane(self, record, plane):
        picture, array = _PLANES[plane]
        if "image" in record:
            from PIL import Image  # where it is missing, ask for format = "npy"

            path = self.folder / "frames" / f"{picture}_{record['index']:08d}.png"
            values = np.asarray(Image.open(_read(path)))
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
    """Writes annotations in COCO's form: a mask of each class and of the needle in each picture.

    Masks are run lengths (pycocotools reads them); file names are relative to the data set's folder.
    """
    if data.records and "image" not in data.records[0]:
        where = getattr(data, "folder", "frames that are drawn")
        raise Error(f"{where}: COCO names picture files: ask sonoplay dataset for format = \"png\"")
    categories = [{"id": i, "name": n} for i, n in enumerate(data.classes) if i > 0]
    needle = len(data.classes)
    categories.append({"id": needle, "name": "needle"})
    images, annotations = [], []
    whole = DataSet(data.folder, None, ("labels", "needle"), classes=data.classes)
    whole.records = data.records
    for record, frame in zip(data.records, whole):
        height, width = frame["image"].shape
        images.append({"id": record["index"], "file_name": record["image"], "width": width,
                       "height": height, "mm_per_px": record.get("mm_per_px")})
        masks = [(int(c), frame["labels"] == c) for c in np.unique(frame["labels"]) if c > 0]
        masks.append((needle, frame["needle"] > 0))
        for category, mask in masks:
            rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
            if not rows.size:
                continue
            box = [int(columns[0]), int(rows[0]), int(columns[-1] - columns[0] + 1),
                   int(rows[-1] - rows[0] + 1)]
            annotations.append({"id": len(annotations) + 1, "image_id": record["index"],
                                "category_id": category, "iscrowd": 0, "bbox": box,
                                "area": int(mask.sum()),
                                "segmentation": {"size": [height, width], "counts": _runs(mask)}})
    path = pathlib.Path(path)
    partial = path.with_name(path.name + ".part")
    partial.write_text(json.dumps({"images": images, "annotations": annotations,
                                   "categories": categories}))
    partial.replace(path)


def write_webdataset(data, pattern, frames_per_shard=1000):
    """Writes tar files as WebDataset reads them: NNNNNNNN.image.npy, .labels.npy, ... and .json.

    pattern   with one number, as in "abdomen-%06d.tar"; the same data give the same bytes
    """
    if not re.search(r"%0?\d*d", str(pattern)):
        raise ValueError("pattern: expected a number in it, as in abdomen-%06d.tar")

    def add(tar, name, content):
        entry = tarfile.TarInfo(name)
        entry.size = len(content)
        tar.addfile(entry, io.BytesIO(content))

    for shard, first in enumerate(range(0, len(data), frames_per_shard)):
        path = pathlib.Path(str(pattern) % shard)
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(path.name + ".part")
        with tarfile.open(partial, "w", format=tarfile.USTAR_FORMAT) as tar:
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
        partial.replace(path)


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
    parser = argparse.ArgumentParser(prog="python3 -m sonocase.data", description=__doc__.split("\n")[0])
    parser.add_argument("form", choices=["coco", "webdataset", "zarr"])
    parser.add_argument("folder", help="that sonoplay dataset wrote")
    parser.add_argument("-o", "--out", required=True,
                        help="coco: a .json file; webdataset: shards, as in abdomen-%%06d.tar; "
                             "zarr: a new folder")
    parser.add_argument("--split", choices=["train", "validate", "test"])
    parser.add_argument("--frames-per-shard", type=int, default=1000)
    parser.add_argument("--frames-per-chunk", type=int, default=16, help="zarr")
    parser.add_argument("--plain", action="store_true", help="zarr: chunks without compression")
    chosen = parser.parse_args(arguments)
    try:
        data = DataSet(chosen.folder, chosen.split, tuple(p for p in _PLANES if p != "image"))
        if chosen.form == "coco":
            write_coco(data, chosen.out)
        elif chosen.form == "zarr":
            write_zarr(data, chosen.out, chosen.frames_per_chunk, not chosen.plain)
        else:
            write_webdataset(data, chosen.out, max(1, chosen.frames_per_shard))
    except (Error, ValueError, OSError, TypeError) as error:
        print(f"sonocase.data: {error}", file=sys.stderr)
        return 1
    print(f"{len(data)} frames, {len(data.classes)} classes: {chosen.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
