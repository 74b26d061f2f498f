# SPDX-License-Identifier: Apache-2.0
"""The samples of docs/examples/stages find what is right, and every stage has one."""

import importlib.util
import os
import pathlib
import re
import sys

import pytest

ROOT = pathlib.Path(__file__).parents[2]
SAMPLES = ROOT / "docs" / "examples" / "stages"
NAMES = sorted(path.stem for path in SAMPLES.glob("*.py") if path.stem not in ("__main__", "body"))


@pytest.fixture
def sample(monkeypatch):
    """Loads one by its file: `import` is no name for a module."""
    if not pathlib.Path(os.environ["SONOCASE_BIN"], "sonocase").exists():
        pytest.skip("built without the pipeline")
    monkeypatch.syspath_prepend(str(SAMPLES))

    def load(name):
        spec = importlib.util.spec_from_file_location("sample_" + name, SAMPLES / (name + ".py"))
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    yield load
    sys.modules.pop("body", None)


@pytest.mark.parametrize("name", NAMES)
def test_sample_finds_what_is_right(name, sample, tmp_path):
    text, found, right, tolerance = sample(name).show(tmp_path)
    assert found == pytest.approx(right, rel=tolerance, abs=tolerance if right == 0 else 0), text


def test_every_stage_has_a_sample():
    table = (ROOT / "pipeline" / "stages" / "built_in_stages.h").read_text()
    assert set(re.findall(r"StageDescriptor (\w+)_stage\(\);", table)) == set(NAMES)
