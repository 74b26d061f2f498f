# SPDX-License-Identifier: Apache-2.0
"""A small case and a session on it, written by core_write_case: a round body with a vessel."""

import os
import pathlib
import subprocess

import pytest

import sonocase

BIN = pathlib.Path(os.environ["SONOCASE_BIN"])


@pytest.fixture
def hard_case(request):
    """hard_case(what, value, most): a figure of docs/numerics.md, as tests/support/hard_case.h has them. The value is
    held to the limit and to the document; scripts/hard-cases writes it."""
    def see(what, value, most=0):
        assert value <= most, what
        tail = f" (at most {most:g})"
        if path := os.environ.get("SONOCASE_HARD_CASES"):
            with open(path, "a") as file:
                file.write(f"{request.node.originalname}\t{what}\t{value:.2g}\t{tail}\n")
            return
        page = (pathlib.Path(__file__).parents[2] / "docs" / "numerics.md").read_text()
        assert f"{what}: {value:.2g}{tail}" in page, "scripts/hard-cases writes it anew"
    return see


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    folder = tmp_path_factory.mktemp("case")
    case, session = folder / "small.sonocase", folder / "small.igs.mha"
    subprocess.run([BIN / "core_write_case", case, session], check=True)
    return case, session


@pytest.fixture(scope="session")
def flowing(tmp_path_factory):
    """The same case with blood that flows in its vessel."""
    folder = tmp_path_factory.mktemp("flowing")
    case = folder / "flowing.sonocase"
    subprocess.run([BIN / "core_write_case", case, folder / "small.igs.mha", "flow"], check=True)
    return case


@pytest.fixture(scope="session")
def with_cyst(tmp_path_factory):
    """The same case with an exercise `cyst`, whose target is one, beside the vessel."""
    folder = tmp_path_factory.mktemp("cyst")
    case = folder / "cyst.sonocase"
    subprocess.run([BIN / "core_write_case", case, folder / "small.igs.mha", "lesion"], check=True)
    return case


@pytest.fixture
def case(small):
    return sonocase.Case.open(small[0])


@pytest.fixture
def pose(case):
    return sonocase.Pose.on_skin(case, case.exercise().start_pose[:3, 3], (0, 0, -1))


@pytest.fixture(scope="session")
def sonoplay():
    def run(*arguments, check=True):
        return subprocess.run([BIN / "sonoplay", *map(str, arguments)], check=check,
                              capture_output=True, text=True)
    return run
