# SPDX-License-Identifier: Apache-2.0
"""What the samples share: a body of simple shapes as a label map, the verb that runs one stage, and its report."""

import gzip
import json
import os
import pathlib
import subprocess

import numpy as np

SONOCASE = pathlib.Path(os.environ.get("SONOCASE_BIN", "build/release/bin"), "sonocase")
HALF_AXES_MM = np.array([50.0, 38, 55])


def sonocase(*arguments):
    """Runs the program; gives what it printed."""
    done = subprocess.run([SONOCASE, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(done.stderr)
    return done.stdout


def stage(folder, verb, *arguments):
    """Runs the verb of a stage; gives its report."""
    report = folder / (verb + ".report.json")
    sonocase(verb, *arguments, "--report", report, "--quiet")
    return json.loads(report.read_text())


def points(edge_vx, voxel_mm):
    """x, y, z of the centres of a cube's voxels, mm, arrays (z, y, x); its middle is the origin."""
    z, y, x = (np.indices((edge_vx,) * 3) - (edge_vx - 1) / 2) * voxel_mm
    return x, y, z


def write_labels(folder, volume, voxel_mm, names):
    """A label map as MetaImage, and the table of its names and tissues from value 1 on."""
    corner_mm = -voxel_mm * (np.array(volume.shape[::-1]) - 1) / 2
    header = f"""NDims = 3
DimSize = {" ".join(map(str, volume.shape[::-1]))}
ElementSpacing = {voxel_mm} {voxel_mm} {voxel_mm}
TransformMatrix = 1 0 0 0 1 0 0 0 1
Offset = {" ".join(map(str, corner_mm))}
ElementType = MET_UCHAR
ElementDataFile = LOCAL
"""
    labels, table = folder / "labels.mha", folder / "labels.csv"
    labels.write_bytes(header.encode() + volume.astype(np.uint8).tobytes())
    rows = [f"{value},{name},{tissue}\n" for value, (name, tissue) in enumerate(names, 1)]
    table.write_text("value,name,tissue_class\n" + "".join(rows))
    return labels, table


def read_labels(path):
    """The voxels (z, y, x) of an NRRD file that a stage wrote."""
    header, data = path.read_bytes().split(b"\n\n", 1)
    size = next(line for line in header.decode().splitlines() if line.startswith("sizes: "))
    return np.frombuffer(gzip.decompress(data), np.uint8).reshape([int(n) for n in size.split()[:0:-1]])


def torso(folder):
    """An ellipsoid of fat with a ball of liver and a tube of blood from end to end: labels and table."""
    x, y, z = points(60, 2)
    a, b, c = HALF_AXES_MM
    volume = (x**2 / a**2 + y**2 / b**2 + z**2 / c**2 < 1).astype(np.uint8)
    volume[(x - 12) ** 2 + y**2 + z**2 < 18**2] = 2
    volume[((x + 20) ** 2 + y**2 < 4**2) & (volume > 0)] = 3
    return write_labels(folder, volume, 2, [("torso", "fat"), ("organ", "liver"), ("tube", "blood")])


def fit(folder, labels, table):
    """Fits the body to a mannequin that is larger by 5 mm on every side; writes fit.json, gives the report."""
    random = np.random.default_rng(1)
    towards = random.normal(size=(1500, 3))
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    readings = towards * (HALF_AXES_MM + 5) + random.normal(0, 0.3, towards.shape)
    np.savetxt(folder / "readings.csv", readings, "%.2f", ",", header="x,y,z", comments="")
    return stage(folder, "register", "--labels", labels, "--table", table, "--surface", folder / "readings.csv",
                 "--axes", "ras", "--up=0,0,1", "-o", folder / "fit.json")


def cooked(folder):
    """The body's labels as the stages after resample take them."""
    labels, table = torso(folder)
    fit(folder, labels, table)
    stage(folder, "import", labels, "--table", table, "-o", folder / "ct.labels")
    stage(folder, "resample", folder / "ct.labels", "--registration", folder / "fit.json", "--voxel-mm", 2,
          "-o", folder / "cooked.labels")
    return folder / "cooked.labels"
