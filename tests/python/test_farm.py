# SPDX-License-Identifier: Apache-2.0
"""Data sets rendered by the farm, on this machine: the same bytes, and what fails is said."""

import json
import os
import pathlib
import shutil
import subprocess
import sys

import pytest

from conftest import BIN
from test_dataset import content_of, recipe  # noqa: F401  (a fixture)

FARM = pathlib.Path(__file__).parents[2] / "scripts" / "farm"
RENDER = FARM / "render-dataset"
needs_snakemake = pytest.mark.skipif(shutil.which("snakemake") is None, reason="no snakemake")


def render(*arguments):
    return subprocess.run([RENDER, "--sonoplay", BIN / "sonoplay", *map(str, arguments)],
                          capture_output=True, text=True)


@pytest.mark.parametrize("end, status", [("sys.exit(3)", 3), ("os.kill(os.getpid(), 9)", 137)])
def test_a_job_that_fails_says_what_it_took(end, status, tmp_path):
    peak = tmp_path / "peak"
    job = f"import os, sys; held = b'1' * 200_000_000; {end}"
    done = subprocess.run([FARM / "run-stage", peak, sys.executable, "-c", job])
    assert done.returncode == status
    assert 200 < float(peak.read_text()) < 300
    assert subprocess.run([FARM / "run-stage", peak, "true"]).returncode == 0
    assert not peak.exists()


def test_a_second_try_asks_by_what_the_first_took(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    source = (FARM / "Snakefile").read_text()
    names = {"stages_of": {"case": {"import": {"memory_mb": 240}}}}
    exec(source[source.index("def peak"):source.index("def launcher")], names)
    asked = [names["memory_mb"]("case", "import", attempt) for attempt in (1, 2, 3)]
    assert asked == [304, 608, 1216]  # 240 and a fifth and 16 MB; twice; four times
    (tmp_path / "logs" / "case").mkdir(parents=True)
    (tmp_path / "logs" / "case" / "import.peak").write_text("1461\n")
    assert names["memory_mb"]("case", "import", 2) == 2191


@pytest.fixture
def killing_profile(tmp_path):
    """Hands a job over as Slurm's does, and kills the first two that ask for memory."""
    profile = tmp_path / "killing"
    profile.mkdir()
    (profile / "config.yaml").write_text("cores: 2\nrestart-times: 3\nquiet: rules\n")
    launch = profile / "launch"
    launch.write_text('#!/bin/sh\n'
                      f'echo "$2 $3" >>{profile}/asked\n'
                      f'[ "$(wc -l <{profile}/asked)" -gt 2 ] || exit 137\n'
                      'shift 3\nexec "$@"\n')
    launch.chmod(0o755)
    return profile


@pytest.fixture
def stub(tmp_path):
    """Stands for sonocase: its plan, one stage's report, and a check without faults. While a file `hold` is there, a build
    says so in a pipe `begun` and then waits for a signal."""
    stage = {"stage": "pack", "key": "0123456789abcdef", "needs": [], "memory_mb": 240, "threads": 2, "seconds": 1, "why": "new"}
    plan = {"arguments": [], "cases": [{"name": "case", "recipe": "case", "done": False, "stages": [stage]}]}
    stub = tmp_path / "sonocase"
    stub.write_text(f"""#!{sys.executable}
import pathlib, signal, sys
words = sys.argv[1:]
if words[0] == "plan":
    pathlib.Path(words[words.index("-o") + 1], "plan.json").write_text({json.dumps(plan)!r})
elif words[0] == "build":
    if pathlib.Path({str(tmp_path / "hold")!r}).exists():
        pathlib.Path({str(tmp_path / "begun")!r}).write_text("begun")
        signal.pause()
    report = pathlib.Path(words[words.index("--report") + 1])
    report.write_text('{{"digest": "d", "stages": [], "warnings": [], "peak_mb": 1}}')
    pathlib.Path(words[words.index("-o") + 1]).touch()
elif words[0] == "check":
    print('{{"faults": [], "remarks": []}}')
""")
    stub.chmod(0o755)
    (tmp_path / "farm" / "cases").mkdir(parents=True)
    return stub


@needs_snakemake
def test_who_stops_the_driver_stops_the_run_and_has_the_page(stub, tmp_path):
    folder = tmp_path / "farm"
    (tmp_path / "hold").touch()
    os.mkfifo(tmp_path / "begun")
    command = [FARM / "build-cases", "--sonocase", stub, "-o", folder, "case"]
    driver = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    assert (tmp_path / "begun").read_text() == "begun"
    driver.terminate()
    said = driver.communicate()[1]
    assert driver.returncode == 1 and "start it again" in said
    assert (folder / "index.html").exists()
    (tmp_path / "hold").unlink()
    done = subprocess.run(command, capture_output=True, text=True)  # at once: nothing holds the lock
    assert done.returncode == 0, done.stdout + done.stderr


@needs_snakemake
def test_each_try_of_a_stage_hands_more_memory_over(killing_profile, stub, tmp_path):
    folder = tmp_path / "farm"
    done = subprocess.run([FARM / "build-cases", "--sonocase", stub, "--profile", killing_profile, "-o", folder, "case"],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr + (folder / "logs" / "snakemake.log").read_text()
    assert (killing_profile / "asked").read_text().splitlines()[:3] == ["2 304", "2 608", "2 1216"]


@needs_snakemake
def test_each_try_of_a_shard_hands_more_memory_over(killing_profile, recipe, tmp_path):
    done = render(recipe, "-o", tmp_path / "out", "--frames", 4, "--shards", 1, "--profile", killing_profile)
    assert done.returncode == 0, done.stderr
    assert (killing_profile / "asked").read_text().splitlines() == ["1 2000", "1 4000", "1 6000"]


def test_the_page_says_what_is_faulty_what_failed_why_and_what_it_cost(tmp_path):
    stages = [{"stage": "warp", "key": "a" * 32, "seconds": 20.5, "why": "s.csv <new> changed"},
              {"stage": "pack", "key": "b" * 32, "seconds": 2, "why": "after warp"}]
    names = ["good", "faulty", "unlooked", "stuck-1", "stuck-2"]
    plan = {"cases": [{"name": name, "recipe": name, "stages": stages} for name in names]}
    (tmp_path / "plan.json").write_text(json.dumps(plan))
    for folder in ("cases", "checks"):
        (tmp_path / folder).mkdir()
    work = [{"stage": "warp", "seconds": 30}, {"stage": "pack", "seconds": 2}]
    for name in names[:3]:
        (tmp_path / "state" / name).mkdir(parents=True)
        for stage in stages:
            report = {"digest": name, "stages": work, "warnings": [], "peak_mb": 1}
            (tmp_path / "state" / name / f"{stage['stage']}.{stage['key']}.json").write_text(json.dumps(report))
        (tmp_path / "cases" / f"{name}.sonocase").touch()
    fault = {"name": "sides", "what": "liver on the left", "remedy": "turn the map"}
    for name, faults in (("good", []), ("faulty", [fault])):
        said = {"faults": faults, "remarks": ["small"]}
        (tmp_path / "checks" / f"{name}.{'b' * 32}.json").write_text(json.dumps(said))
    for name in names[3:]:
        (tmp_path / "logs" / name).mkdir(parents=True)
        (tmp_path / "logs" / name / "warp.log").write_text(f"== now\nsonocase build: {name}.nii: no such file\n")
    (tmp_path / "logs" / "cache.log").write_text("6 entries, 12.0 MB; removed: 2 over the limit, 0 left by killed writers\n")
    done = subprocess.run([FARM / "index-page", tmp_path], capture_output=True, text=True)
    assert done.returncode == 1 and "1 with faults" in done.stdout
    page = (tmp_path / "index.html").read_text()
    assert "liver on the left: turn the map" in page and "no fault, 1 to note" in page
    assert page.count("not looked over") == 1
    assert "<b>2</b>: warp: sonocase build: CASE.nii: no such file" in page
    # Of the two that are not built all is to come.
    assert "Work in them: 96 s (warp 90, pack 6); to come: about 45 s of processors" in page
    assert page.count("<li>warp: s.csv &lt;new&gt; changed</li>") == 5 and "after warp" not in page
    assert "Cache: 6 entries, 12.0 MB; removed: 2 over the limit" in page


@needs_snakemake
def test_shards_of_the_farm_give_the_same_bytes(recipe, sonoplay, tmp_path):
    whole, farmed = tmp_path / "whole", tmp_path / "farmed"
    sonoplay("dataset", recipe, "-o", whole, "--frames", 13, "--seed", 5)
    done = render(recipe, "-o", farmed, "--frames", 13, "--seed", 5, "--shards", 3)
    assert done.returncode == 0, done.stderr
    shutil.rmtree(farmed / "farm")
    assert content_of(farmed) == content_of(whole)


@needs_snakemake
def test_a_bad_recipe_is_said_by_shard(recipe, tmp_path):
    recipe.write_text(recipe.read_text().replace("chunk = 3", "chunky = 3"))
    done = render(recipe, "-o", tmp_path / "out", "--frames", 4, "--", "--restart-times", "0")
    assert done.returncode == 1
    assert done.stderr.count("chunky") == 2  # of two shards
    assert not (tmp_path / "out" / "manifest.jsonl").exists()


@pytest.mark.parametrize("arguments, words", [
    ((), "no recipe"), (("none.toml", "-o", "x", "--frames", 3), "none.toml"),
    ((RENDER, "--frames", 3), "no -o"), ((RENDER, "-o", "x"), "--frames"),
    ((RENDER, "-o", "x", "--frames", 0), "--frames"), ((RENDER, "-o", "x", "--frams", 3), "--frams"),
    ((RENDER, "-o", "x", "--frames", 3, "--shards", "two"), "two"),
    ((RENDER, "-o", "x", "--frames", 3, "--profile", "moon"), "moon")])
def test_wrong_usage_is_one_line(arguments, words):
    done = render(*arguments)
    assert done.returncode == 2 and words in done.stderr and done.stderr.count("\n") == 1
