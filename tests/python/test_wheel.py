# SPDX-License-Identifier: Apache-2.0
"""pip install . : the whole package by our build back end, without a network, into an environment of its own."""

import pathlib
import platform
import subprocess
import sys

import pytest

from conftest import BIN

ROOT = pathlib.Path(__file__).parents[2]


def pip(*arguments, **more):
    return subprocess.run([sys.executable, "-m", "pip", "--disable-pip-version-check", *map(str, arguments)],
                          capture_output=True, text=True, **more)


@pytest.mark.skipif(pip("--version").returncode != 0, reason="no pip")
def test_pip_installs_a_package_that_renders(small, tmp_path):
    """From the build at hand: what pip would compile anew is the same target with the same options."""
    done = pip("install", ROOT, "--config-settings", f"build={BIN.parent}", "--no-index", "--target", tmp_path / "site")
    assert done.returncode == 0, done.stderr  # with all that it depends on: nothing
    names = {path.name for path in (tmp_path / "site" / "sonocase").iterdir()}
    assert {"__init__.py", "__init__.pyi", "py.typed", "data.py", "domain.py", "environment.py", "pose.py", "pose.pyi"} <= names
    program = f"""
import sonocase, numpy
assert sonocase.__file__.startswith({str(tmp_path)!r}), sonocase.__file__
case = sonocase.Case.open({str(small[0])!r})
pose = sonocase.Pose.on_skin(case, case.exercise().start_pose[:3, 3], (0, 0, -1))
assert sonocase.Renderer(case, size=(64, 64)).render(pose).any()
import importlib.metadata
print(importlib.metadata.version("sonocase"))
"""
    shown = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True,
                           env={"PYTHONPATH": str(tmp_path / "site")})
    assert f"VERSION {shown.stdout.strip()}" in (ROOT / "CMakeLists.txt").read_text()
    metadata, = (tmp_path / "site").glob("sonocase-*.dist-info/METADATA")
    # Only data sets and environments need NumPy; 2 as well, nothing is compiled against it.
    assert 'Requires-Dist: numpy>=1.24; extra == "data"\n' in metadata.read_text()
    # The module is of one Python and of this machine's libraries, and its name promises no more.
    tag, = (line.split(" ")[1] for line in (metadata.parent / "WHEEL").read_text().splitlines() if line.startswith("Tag: "))
    assert tag == f"cp3{sys.version_info.minor}-cp3{sys.version_info.minor}-linux_{platform.machine()}"
    again = pip("install", ROOT, "--config-settings", f"build={tmp_path}", "--no-index", "--target", tmp_path / "other")
    assert again.returncode != 0 and "CMakeCache.txt" in again.stderr + again.stdout
    assert not (tmp_path / "other").exists()
