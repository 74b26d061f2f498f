# SPDX-License-Identifier: Apache-2.0
"""The samples of docs/examples/effects: each shows its effect, and docs/effects.md has it beside its picture."""

import importlib
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

import sonocase

ROOT = pathlib.Path(__file__).parents[2]
SAMPLES = ROOT / "docs" / "examples" / "effects"
NAMES = sorted(path.stem for path in SAMPLES.glob("p*-*.py"))
DATA = ROOT / ".." / "shared" / "data"


@pytest.fixture(scope="module")
def torso(tmp_path_factory):
    program = pathlib.Path(os.environ["SONOCASE_BIN"], "sonocase")
    if not (DATA.is_dir() and program.exists()):
        pytest.skip("needs the real data in ../shared/data and the pipeline")
    bundle = tmp_path_factory.mktemp("torso") / "torso.sonocase"
    cache = os.environ.get("SONOCASE_TEST_CACHE", bundle.parent / "cache")
    subprocess.run([program, "build", ROOT / "scenarios/real-torso", "--data", DATA, "--preset", "draft", "--cache", cache, "--quiet",
                    "-o", bundle], check=True)
    sys.path.insert(0, str(SAMPLES))
    yield importlib.import_module("torso").Torso(sonocase.Case.open(bundle))
    sys.path.remove(str(SAMPLES))


@pytest.mark.parametrize("name", NAMES)
def test_sample_shows_its_effect(name, torso):
    on, off, text, larger, smaller = importlib.import_module(name).show(torso)
    assert np.sum(np.abs(on.astype(int) - off) >= 4) > 200, "what an eye finds when it looks for it"
    assert larger > 1.02 * smaller, f"{text}: {larger}, {smaller}"


@pytest.mark.parametrize("name", NAMES)
def test_page_has_the_picture_and_the_sample(name):
    page = (ROOT / "docs" / "effects.md").read_text()
    assert f"(examples/effects/{name}.py)" in page and f"(pictures/effects/{name}.png)" in page
    assert Image.open(ROOT / "docs" / "pictures" / "effects" / f"{name}.png").size == (604, 300)
