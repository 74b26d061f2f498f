# SPDX-License-Identifier: Apache-2.0
"""Frames of drawn machines, probes, poses and needles: domain randomisation as data, with its seed.

    from sonocase.domain import DrawnFrames
    frames = DrawnFrames("demo.sonocase", {
        "gain_db": [-6, 6],                                  # a range
        "machine": {"base": ["modern", "classic"],           # one of these names
                    "grey": {"level": [40, 70]}, "tissue_db": {"liver": [-3, 3]}},
        "probe": {"depth_mm": {"one_of": [120, 160]}},       # one of these numbers
        "needle": {"share": 0.5, "tip_depth_mm": [20, 80]}}, seed=7, count=1000)
    frame = frames[0]               # as of a DataSet: "image", "labels", "needle", ...
    frames.records[0]               # everything that was drawn, fit for JSON
    picture(frames.records[0])      # the same picture, of its record alone

A value is drawn from the seed, the number of the sample (or of its chunk) and the value's key alone:
the same in any order and process, and unmoved by other keys that come or go.
"""

import difflib
import hashlib
import json
import math
import operator
import os
import pathlib
import re
import tempfile

import numpy as np

from . import _core
from . import pose as _pose
from ._core import Case, Error, Probe, Renderer
from .data import checked_planes, common_classes, facts_in_classes, in_classes

# Keys of a probe, and of a needle beside where it goes, with their limits: those of an exercise's file.
PROBE = {"shape": None, **_core._PROBE_LIMITS}
NEEDLE = {"make": None, "gauge": _core._GAUGE_LIMITS}
PLANES = ("labels", "needle", "shadowed", "skin_depth_mm", "lesions", "rest_mm")

# What a sample draws beside machine and probe: standard, and limits.
_SAMPLE = {
    "gain_db": (0.0, *_core._LIMITS["gain_db"]),
    "dynamic_range_db": (60.0, *_core._LIMITS["dynamic_range_db"]),
    "pose.slide_mm": ([-15, 15], -500, 500),   # along the face and across it, one draw each
    "pose.tilt_deg": ([-15, 15], -90, 90),
    "pose.rock_deg": ([-10, 10], -90, 90),
    "pose.rotate_deg": ([-20, 20], -180, 180),
    "pose.press_mm": (0.0, *_core._LIMITS["press_mm"]),
    "pose.time_s": ([0, 8], 0, 1e6),
    "needle.share": (0.0, 0, 1),
    "needle.tip_depth_mm": ([20, 80], 0, 500),
    "needle.tip_across_mm": ([-10, 10], -200, 200),
    "needle.angle_deg": ([25, 65], 0, 90),     # between shaft and beam
    "needle.off_plane_mm": ([-2, 2], -100, 100),
    "needle.tent_mm": (0.0, *_core._LIMITS["dent_mm"]),
    "needle.drag_mm": (0.0, *_core._LIMITS["dent_mm"]),
}
_CONSOLE = ("gain_db", "dynamic_range_db")
_TABLES = ("machine", "probe", "pose", "needle")
_OTHERS = ("chunk", "exercises", "model")
# The machine's reader takes these as whole numbers alone.
_WHOLE = ("machine.looks.count", "machine.looks.near_count", "machine.beam.lines",
          "machine.near_field.lines")


def _native(value, key):
    """As JSON has it: NumPy's numbers and arrays as Python's, paths as text."""
    if isinstance(value, dict):
        return {str(k): _native(v, f"{key}.{k}" if key else k) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_native(v, key) for v in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return _native(value.tolist(), key)
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise ValueError(f"{key}: of type {type(value).__name__}; expected a number, text, a list or a table")


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


class _Choice:
    """A value, a range or a list to choose from, under its key."""

    def __init__(self, key, given, limits=None):
        self.key, self.low, self.high, self.options = key, None, None, None
        if isinstance(given, dict):
            if set(given) != {"one_of"}:
                raise ValueError(f"{key}: expected a value, [lowest, highest] or {{\"one_of\": [...]}}")
            self.options = given["one_of"]
            if not isinstance(self.options, (list, tuple)) or not self.options:
                raise ValueError(f"{key}: one_of is empty or no list: give at least one value")
            self.options = list(self.options)
        elif isinstance(given, (list, tuple)):
            if given and all(isinstance(v, str) for v in given):
                self.options = list(given)
            elif len(given) == 2 and all(map(_is_number, given)):
                self.low, self.high = given
            else:
                raise ValueError(f"{key}: {given!r} is no range: expected [lowest, highest], both numbers")
        else:
            self.options = [given]
        for value in self.options or (self.low, self.high):
            if value is None:
                raise ValueError(f"{key}: null is no value: leave the key out")
            if limits is not None and not _is_number(value):
                raise ValueError(f"{key}: {value!r} is not a number")
            if _is_number(value) and not math.isfinite(value):
                raise ValueError(f"{key}: {value} is not finite")
            if limits is not None and not limits[0] <= value <= limits[1]:
                raise ValueError(f"{key}: {value} is out of range: give {limits[0]:g} to {limits[1]:g}")
        if self.options is None:
            if self.low > self.high:
                raise ValueError(f"{key}: the range {[*given]} is reversed: give its lower end first")
            if key in _WHOLE and not all(isinstance(v, int) for v in given):
                raise ValueError(f"{key}: the range {[*given]} is of whole numbers alone")

    def draw(self, seed, number, part=""):
        # Not NumPy's generators, whose streams may change from version to version.
        text = f"{seed}/{number}/{self.key}{part}"
        bits = int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "big") >> 11
        share = bits / 2**53
        if self.options is not None:
            return self.options[int(share * len(self.options))]
        if self.key in _WHOLE:
            return self.low + int(share * (self.high - self.low + 1))
        return min(self.low + share * (self.high - self.low), float(self.high))

    def corner(self, n):
        """Its n-th extreme value, so that all limits can be tried."""
        if self.options is not None:
            return self.options[min(n, len(self.options) - 1)]
        return self.high if n else self.low


def _leaves(table, key):
    if not isinstance(table, dict):
        raise ValueError(f"{key}: expected a table of keys")
    for name, value in table.items():
        if isinstance(value, dict) and set(value) != {"one_of"}:
            yield from _leaves(value, f"{key}.{name}")
        else:
            yield f"{key}.{name}", (key, name), value


def _refuse_unknown(key, known):
    if key not in known:
        near = difflib.get_close_matches(key, known, 1, 0.5)
        raise ValueError(f"{key}: no such key" + (f": did you mean {near[0]}?" if near else ""))


class Domain:
    """What is drawn and from which ranges: a checked description, a plain dict as JSON or TOML give it.

    chunk       samples that share case, exercise, model, machine, probe and the needle's make, whose
                change costs as much as several frames; 16 by default
    exercises   names; by default all of the case
    model       "physical" or "paper"; by default the exercise's
    machine     names or paths, or a table: base and any key of a machine (formats/machine)
    probe       keys of sonocase.Probe, in place of the exercise's
    pose        slide_mm, tilt_deg, rock_deg, rotate_deg, press_mm, time_s
    needle      share, tip_depth_mm, tip_across_mm, angle_deg, off_plane_mm, tent_mm, drag_mm; make
                and gauge, in place of the exercise's
    gain_db, dynamic_range_db   of the console

    Each but chunk is a value, [lowest, highest] or {"one_of": [...]}; a list of words is a choice.
    Numbers and arrays of NumPy are taken as well.
    """

    def __init__(self, description):
        if not isinstance(description, dict):
            raise ValueError("description: expected a dict")
        self.description = description = _native(description, "")
        for key in description:
            _refuse_unknown(key, [*_OTHERS, *_TABLES, *_CONSOLE])
        self.chunk = description.get("chunk", 16)
        if not isinstance(self.chunk, int) or isinstance(self.chunk, bool) or self.chunk < 1:
            raise ValueError(f"chunk: {self.chunk!r} is no whole number from 1 on")
        given = {key: description[key] for key in _CONSOLE if key in description}
        for table in ("pose", "needle"):
            given.update({key: value for key, _, value in _leaves(description.get(table, {}), table)})
        self.needle = {name: _Choice(f"needle.{name}", given.pop(f"needle.{name}"), limits)
                       for name, limits in NEEDLE.items() if f"needle.{name}" in given}
        for make in self.needle["make"].options or [None] if "make" in self.needle else ():
            if make not in _core._NEEDLE_MAKES:
                raise ValueError(f"needle.make: no make {make}: give some of {', '.join(_core._NEEDLE_MAKES)}")
        for key in given:
            _refuse_unknown(key, [*_SAMPLE, *(f"needle.{name}" for name in NEEDLE)])
        self.sample = {key: _Choice(key, given.get(key, standard), limits)
                       for key, (standard, *limits) in _SAMPLE.items()}
        self.dents = "needle.tent_mm" in given or "needle.drag_mm" in given
        self.exercises = self._words("exercises")
        self.model = self._words("model")
        self.probe = {}
        for key, (_, name), value in _leaves(description.get("probe", {}), "probe"):
            _refuse_unknown(key, [f"probe.{k}" for k in PROBE])
            self.probe[name] = _Choice(key, value, PROBE[name])
        machine = description.get("machine", "")
        keyed = isinstance(machine, dict) and set(machine) != {"one_of"}
        self.machine_name = None if keyed else self._words("machine", "")
        if self.machine_name is not None:  # files, for a process that stands elsewhere
            self.machine_name.options = [os.path.abspath(name) if os.sep in name or name.endswith(".toml") else name
                                         for name in self.machine_name.options]
        self.machine = [(path, _Choice(key, value))
                        for key, path, value in _leaves(machine, "machine")] if keyed else []

    def _words(self, key, standard=None):
        if key not in self.description and standard is None:
            return None
        choice = _Choice(key, self.description.get(key, standard))
        for word in choice.options or (choice.low,):
            if not isinstance(word, str):
                raise ValueError(f"{key}: {word!r} is no name")
        return choice

    def machine_of(self, value):
        """A name, or a table of a machine's keys, each by value(choice)."""
        if self.machine_name is not None:
            return value(self.machine_name)
        machine = {}
        for (table, name), choice in self.machine:
            place = machine
            for part in table.split(".")[1:]:
                place = place.setdefault(part, {})
            place[name] = value(choice)
        return machine

    def corners(self):
        """(machine, probe) at the ends of all ranges and with each choice."""
        choices = [*self.probe.values(), *(c for _, c in self.machine), self.machine_name]
        longest = max((2 if c.options is None else len(c.options) for c in choices if c), default=1)
        for n in range(longest):
            yield (self.machine_of(lambda c: c.corner(n)),
                   {name: c.corner(n) for name, c in self.probe.items()})


def _toml(table, name):
    def value(v):
        if isinstance(v, bool):
            return "true" if v else "false"
        if isinstance(v, (list, tuple)):
            return "[" + ", ".join(map(value, v)) + "]"
        return json.dumps(v, ensure_ascii=False)

    quoted = {k: json.dumps(k, ensure_ascii=False) for k in table}
    lines = [f"[{name}]"] + [f"{quoted[k]} = {value(v)}" for k, v in table.items()
                             if not isinstance(v, dict)]
    for k, v in table.items():
        if isinstance(v, dict):
            lines += _toml(v, f"{name}.{quoted[k]}")
    return lines


def _renderer(case, exercise, model, machine, probe, size, seed, needle=None):
    options = {"model": model, "size": tuple(size), "seed": seed}
    exercise = case.exercise(exercise)
    for part, changes in ((exercise.probe, probe), (exercise.needle, needle or {})):
        for name, value in changes.items():
            setattr(part, name, value)
    if not isinstance(machine, dict):
        return Renderer(case, exercise, machine=machine, **options)
    with tempfile.TemporaryDirectory() as folder:  # a machine is given by name or as a file
        path = os.path.join(folder, "machine.toml")
        pathlib.Path(path).write_text("\n".join(_toml(machine, "machine")) + "\n", "utf-8")
        try:
            return Renderer(case, exercise, machine=path, **options)
        except Error as error:
            said = re.sub(re.escape(path) + r"(:\d+)?:? *", "", str(error))
            raise ValueError(said) from None


def renderer_of(record, case=None):
    """The renderer that drew a record's picture; `case` instead of opening the one that it names."""
    case = case or Case.open(record["case"])
    return _renderer(case, record["exercise"], record["model"], record["machine"], record["probe"],
                     record["size"], record["seed"], record["needle"])


def picture(record, renderer=None):
    """The picture of a record, as it was; `renderer` of the same chunk, to make many."""
    return (renderer or renderer_of(record)).render(
        record["mannequin_from_probe"], record["mannequin_from_needle"], record["time_s"],
        frame=record["noise_frame"], gain_db=record["gain_db"],
        dynamic_range_db=record["dynamic_range_db"], press_mm=record["press_mm"],
        dent=record["dent_mm"])


def _plain(value):
    """As JSON has it: lists for arrays, null for what is not a number."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray) and np.isfinite(value).all():
        return value.tolist()
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _whole(value, argument):
    try:
        return operator.index(value)
    except TypeError:
        raise ValueError(f"{argument}: {value!r} is no whole number") from None


def _size(size):
    if isinstance(size, str) or not hasattr(size, "__len__") or len(size) != 2:
        raise ValueError(f"size: {size!r} is no size: give (width, height)")
    return tuple(_whole(n, "size") for n in size)


class _Records:
    def __init__(self, frames):
        self._frames = frames

    def __len__(self):
        return len(self._frames)

    def __getitem__(self, i):
        numbers = range(len(self))[i]
        return [self[n] for n in numbers] if isinstance(i, slice) else self._frames._record(numbers)

    def __iter__(self):
        return (self[i] for i in range(len(self)))


class DrawnFrames:
    """Frames that are rendered when they are asked for, in the form of a DataSet: len(), [i], classes, planes, records.

    cases         path of a bundle, or several, of which each chunk draws one
    description   a dict or a Domain
    seed          of all that is drawn, and of the noise
    count         of samples; a greater one gives the same frames and more
    planes        what a frame holds beside "image"
    facts         also "facts": the record, with the frame's truth
    classes       as of a DataSet

    Bundles are known by their absolute paths, so that records and workers find them from any folder.
    The writers of sonocase.data take it in place of a DataSet; loaders' workers get it by pickling.
    """

    def __init__(self, cases, description, seed=1, count=1000, *, size=(256, 256),
                 planes=("labels", "needle"), facts=False, classes=None):
        self.domain = description if isinstance(description, Domain) else Domain(description)
        self.seed, self.count, self.facts = _whole(seed, "seed"), _whole(count, "count"), facts
        self.size = _size(size)
        if not 0 <= self.seed < 2**32:
            raise ValueError(f"seed: {seed} is out of range: give 0 to 2^32 - 1")
        if self.count < 1:
            raise ValueError(f"count: {count} is out of range: give 1 or more")
        self.planes = checked_planes(planes, PLANES)
        paths = [cases] if isinstance(cases, (str, bytes, os.PathLike)) else cases
        self._case = _Choice("case", {"one_of": [os.path.abspath(os.fsdecode(p)) for p in paths]})
        self._clear()
        opened = {path: self._opened(path) for path in self._case.options}
        self.classes, self._class_of = common_classes(
            {path: [l.name for l in case.labels] for path, case in opened.items()}, classes)
        self._refuse_what_does_nothing(opened.values())
        for case in opened.values():  # each end of each range: the machine's reader says its limits
            for exercise in self._exercises(case).options:
                for machine, probe in self.domain.corners():
                    # The model that begins fastest: machines and probes are checked alike by both.
                    _renderer(case, exercise, "paper", machine, probe, (16, 16), 1)

    def _exercises(self, case):
        return self.domain.exercises or _Choice("exercises", [e.name for e in case.exercises])

    def _refuse_what_does_nothing(self, cases):
        machine = {choice.key: choice for _, choice in self.domain.machine}
        models = set(self.domain.model.options) if self.domain.model else \
            {case.exercise(name).model for case in cases for name in self._exercises(case).options}
        if "machine" in self.domain.description and models == {"paper"}:
            raise ValueError("machine: changes nothing in the model paper: give model = \"physical\"")
        if "dynamic_range_db" in self.domain.description and models == {"paper"}:
            raise ValueError("dynamic_range_db: changes nothing in the model paper: give model = \"physical\"")
        labels = [f"machine.tissue_db.{label.name}" for case in cases for label in case.labels]
        for key in machine:
            if key.startswith("machine.tissue_db."):
                _refuse_unknown(key, labels)
        # Of the built-in machines, classic alone maps echoes to grey by a logarithm.
        key, of_map, of_base = (f"machine.{k}" for k in ("grey.dynamic_range_db", "grey.map", "base"))
        logarithmic = "log" in machine[of_map].options if of_map in machine else \
            of_base in machine and "classic" in machine[of_base].options
        if key in machine and not logarithmic:
            raise ValueError(f"{key}: changes nothing where grey.map is power: give grey.map = \"log\" "
                             "or base = \"classic\", or draw grey.exponent")

    def _clear(self):
        self._cases, self._last = {}, (None, None)
        self.records = _Records(self)

    def __getstate__(self):  # workers open their own cases
        return {k: v for k, v in self.__dict__.items() if k not in ("_cases", "_last", "_stands", "records")}

    def __setstate__(self, state):
        self.__dict__.update(state)
        self._clear()

    def __len__(self):
        """Samples."""
        return self.count

    def __iter__(self):
        return map(self.__getitem__, range(len(self)))

    def _opened(self, path):
        if path not in self._cases:
            self._cases[path] = Case.open(path)
        return self._cases[path]

    def _chunk(self, i):
        """What all of a chunk have in common, and its renderer."""
        number = i // self.domain.chunk
        if self._last[0] == number:
            return self._last[1]
        draw = lambda choice: choice.draw(self.seed, number)  # noqa: E731
        path = draw(self._case)
        case = self._opened(path)
        exercise = case.exercise(draw(self._exercises(case)))
        probe = {name: getattr(exercise.probe, name) for name in PROBE}
        probe.update({name: draw(c) for name, c in self.domain.probe.items()})
        common = {"chunk": number, "case": path, "exercise": exercise.name,
                  "model": draw(self.domain.model) if self.domain.model else exercise.model,
                  "machine": self.domain.machine_of(draw), "probe": probe,
                  "needle": {name: draw(c) for name, c in self.domain.needle.items()}, "size": list(self.size),
                  "seed": self.seed}
        renderer = renderer_of(common, case)
        common.update(mm_per_px=renderer.mm_per_px, origin_px=list(renderer.origin_px))
        exercise = renderer.exercise
        self._stands = _Choice("stand", {"one_of": [
            exercise.start_pose, *(p for name in exercise.sweeps for p in exercise.sweep_poses(name))]})
        self._last = (number, (common, renderer))
        return self._last[1]

    def _record(self, i):
        common, renderer = self._chunk(i)
        case, exercise = self._opened(common["case"]), renderer.exercise
        drawn = {key: c.draw(self.seed, i) for key, c in self.domain.sample.items()}
        slide = np.array([self.domain.sample["pose.slide_mm"].draw(self.seed, i, f".{a}") for a in "xy"])
        stand = self._stands.draw(self.seed, i)
        for part in (1, 0.5, 0):  # off the body: nearer to where the exercise stands
            near = stand[:3, 3] + stand[:3, :2] @ (part * slide)
            pose = _pose.on_skin(case, near, stand[:3, 2], stand[:3, 0])
            if pose is not None:
                break
        else:
            raise Error(f"{common['case']}: exercise {exercise.name}: no skin where it stands")
        pose = _pose.turned(pose, *np.radians([drawn["pose.tilt_deg"], drawn["pose.rock_deg"],
                                               drawn["pose.rotate_deg"]]))
        needle = dent = None
        if _Choice("needle.is", [0, 1]).draw(self.seed, i) < drawn["needle.share"]:
            angle = math.radians(drawn["needle.angle_deg"])
            side = _Choice("needle.side", {"one_of": [-1, 1]}).draw(self.seed, i)
            tip = pose @ [drawn["needle.tip_across_mm"], drawn["needle.off_plane_mm"],
                          drawn["needle.tip_depth_mm"], 1]
            axis = pose[:3, :3] @ [side * math.sin(angle), 0, math.cos(angle)]
            needle = _pose.looking(tip[:3], axis, -pose[:3, 2])  # the bevel faces the probe
            if self.domain.dents:
                dent = [drawn["needle.tent_mm"], drawn["needle.drag_mm"]]
        return _plain({"index": i, **common, "noise_frame": i, "time_s": drawn["pose.time_s"],
                       **{key: drawn[key] for key in _CONSOLE}, "press_mm": drawn["pose.press_mm"],
                       "mannequin_from_probe": pose, "mannequin_from_needle": needle, "dent_mm": dent})

    def __getitem__(self, i):
        """One frame, a dict of arrays; of a slice a list of them."""
        if isinstance(i, slice):
            return [self[n] for n in range(len(self))[i]]
        record = self.records[i]
        renderer = self._chunk(record["index"])[1]
        frame = {"image": picture(record, renderer)}
        if len(self.planes) > 1 or self.facts:
            planes, facts = renderer.truth(self.planes[1:])
            frame.update({plane: getattr(planes, plane) for plane in self.planes[1:]})
            if "labels" in frame:
                frame["labels"] = in_classes(frame["labels"], self._class_of[record["case"]])
            if self.facts:
                truth = facts_in_classes(_plain(facts), self._class_of[record["case"]])
                frame["facts"] = {**record, "truth": truth}
        return frame
