# SPDX-License-Identifier: Apache-2.0
"""The package as a whole: what is public is described, stubs and classes agree, and pip install . by our build back end,
without a network, into an environment of its own."""

import ast
import inspect
import pathlib
import platform
import re
import subprocess
import sys

import pytest

import sonocase
from conftest import BIN

ROOT = pathlib.Path(__file__).parents[2]


def public(kind):
    """Of a class: name and member, those of classes that are not ours left out."""
    return {name: getattr(kind, name) for name in dir(kind) if not name.startswith("_")
            and any(name in vars(base) and base.__module__.startswith("sonocase") for base in kind.__mro__)}


def stubs(file):
    """Names of a stub's classes with their members, and of its functions."""
    tree = ast.parse((pathlib.Path(sonocase.__file__).parent / file).read_text())
    classes = {node.name: {m.target.id if isinstance(m, ast.AnnAssign) else m.name for m in node.body
                           if isinstance(m, (ast.AnnAssign, ast.FunctionDef))}
               for node in tree.body if isinstance(node, ast.ClassDef)}
    return classes, {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_the_stubs_are_the_package():
    classes, functions = stubs("__init__.pyi")
    said = {name for name in sonocase.__all__ if name not in ("Pose", "__version__")}
    assert set(classes) | functions == said
    for name, members in classes.items():
        kind = getattr(sonocase, name)
        assert isinstance(kind, type) and all(hasattr(kind, member) for member in members), name
        assert {m for m in members if not m.startswith("_")} == (set(public(kind)) if name != "Error" else set()), name
    assert stubs("pose.pyi")[1] == {name for name in vars(sonocase.pose) if not name.startswith("_")}
    text = (pathlib.Path(sonocase.__file__).parent / "__init__.pyi").read_text()
    for name in ("data", "domain", "environment"):
        assert f"from . import {name} as {name}\n" in text and inspect.ismodule(getattr(sonocase, name))


def described(thing):
    """Its docstring without the signature that pybind11 writes above it."""
    lines = (inspect.getdoc(thing) or "").strip().split("\n")
    return " ".join(line for line in lines if not re.match(r"\w+\(.*\) -> ", line)).strip()


def test_everything_public_is_described():
    modules = (sonocase, sonocase.pose, sonocase.data, sonocase.domain, sonocase.environment)
    for module in modules:
        assert described(module)
        for name, thing in vars(module).items():
            if name.startswith("_") or not getattr(thing, "__module__", "").startswith("sonocase"):
                continue
            assert described(thing) or not callable(thing), f"{module.__name__}.{name}"
            for member, value in public(thing).items() if isinstance(thing, type) else ():
                if callable(value) or isinstance(value, property):
                    assert described(value), f"{module.__name__}.{name}.{member}"


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
