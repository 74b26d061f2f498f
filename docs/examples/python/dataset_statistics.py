# SPDX-License-Identifier: Apache-2.0
"""dataset_statistics.py DIR: what a data set of `sonoplay dataset` shows, from its manifest alone."""

import collections
import json
import pathlib
import sys


def main(folder):
    frames, seen, area, touching = collections.Counter(), collections.Counter(), collections.Counter(), 0.0
    with open(pathlib.Path(folder, "manifest.jsonl")) as manifest:
        for record in map(json.loads, manifest):
            truth = record["truth"]
            frames[record["split"]] += 1
            touching += truth["contact"]
            for organ in truth["visible"]:
                seen[organ["name"]] += 1
                area[organ["name"]] += organ["area_mm2"]
    total = sum(frames.values())
    print(f"{total} frames:", ", ".join(f"{n} {split}" for split, n in sorted(frames.items())))
    print(f"{100 * touching / total:.0f} % of the beams touch the skin")
    for name, n in seen.most_common(20):
        print(f"{name:28} in {100 * n / total:5.1f} % of frames, {area[name] / n / 100:6.1f} cm2 each")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: dataset_statistics.py DIR")
    main(sys.argv[1])
