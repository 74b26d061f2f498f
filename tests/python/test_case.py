# SPDX-License-Identifier: Apache-2.0
"""What a case says about itself, and the scores of a session on it."""

import json
import os
import pathlib
import subprocess

import numpy as np
import pytest

import sonocase

BIN = pathlib.Path(os.environ["SONOCASE_BIN"])


def test_labels_and_exercises(case):
    assert [label.name for label in case.labels] == ["outside", "muscle", "vessel"]
    assert case.labels[2].tissue == "blood"
    assert case.name == "cylinder" and case.size == (70, 80, 70) and case.voxel_mm == 2
    exercise = case.exercise("scan")
    assert exercise.title == "Find the vessel" and exercise.probe.depth_mm == 100
    assert exercise.targets[0].name == "vessel" and exercise.targets[0].hit_radius_mm == 6
    np.testing.assert_array_equal(exercise.targets[0].centre_mm, [0, 0, 25])
    assert len(exercise.sweep_poses("along")) == 3


def test_the_volume_is_the_body_that_was_drawn(case):
    """A cylinder of radius 60 mm along y, a vessel of radius 6 mm through (0, *, 25)."""
    volume = case.label_volume()
    assert volume.shape == (70, 80, 70) and volume.dtype == np.uint8
    x, _, z = (case.origin_mm[axis] + case.voxel_mm * np.arange(case.size[axis])
               for axis in range(3))
    body = np.hypot(x[None, :], z[:, None]) <= 60
    vessel = np.hypot(x[None, :], z[:, None] - 25) <= 6
    expected = np.where(vessel, 2, body.astype(int))
    np.testing.assert_array_equal(volume, np.broadcast_to(expected[:, None, :], volume.shape))
    points = np.array([[0, 0, 25], [0, 0, 0], [0, 0, 65], [1e9, 0, 0]], float)
    assert case.labels_at(points) == [2, 1, 0, 0]


def test_the_skin_is_where_the_cylinder_ends(case):
    point = case.skin_point((10, 0, 90), (0, 0, -1))
    assert abs(np.hypot(point[0], point[2]) - 60) < 2  # a voxel
    normal = case.skin_normal(point)
    expected = np.array([point[0], 0, point[2]]) / np.hypot(point[0], point[2])
    assert normal @ expected > np.cos(np.radians(8))  # voxels of 2 mm, averaged over 12 mm
    assert case.skin_point((500, 0, 0), (0, 1, 0)) is None


def test_poses_are_rigid_and_do_what_they_say():
    pose = sonocase.Pose.looking((1, 2, 3), (0.2, -0.5, -2), (1, 1, 0))
    np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-15)
    assert np.linalg.det(pose) == pytest.approx(1)
    np.testing.assert_allclose(pose @ sonocase.Pose.inverse(pose), np.eye(4), atol=1e-14)
    there = sonocase.Pose.turned(pose, tilt_rad=0.3)
    assert np.arccos(there[:3, 2] @ pose[:3, 2]) == pytest.approx(0.3)
    np.testing.assert_allclose(there[:3, 0], pose[:3, 0], atol=1e-15)
    np.testing.assert_allclose(sonocase.Pose.turned(there, tilt_rad=-0.3), pose, atol=1e-15)
    np.testing.assert_allclose(sonocase.Pose.moved(pose, (0, 0, 5))[:3, 3],
                               pose[:3, 3] + 5 * pose[:3, 2])


def test_a_session_is_read_and_scored(case, small):
    session = sonocase.read_session(small[1])
    assert session["exercise"] == "scan" and len(session["time_s"]) == 60
    np.testing.assert_allclose(session["mannequin_from_probe"][10, :3, 3], [0, -20, 60])
    score = sonocase.score(case, small[1])
    # One frame every 0.05 s; the needle goes straight down through the vessel at (0, *, 25).
    assert score["metrics"]["elapsed_time_s"] == pytest.approx(2.95)
    assert score["targets"][0]["name"] == "vessel"
    with pytest.raises(sonocase.Error, match="no such file"):
        sonocase.score(case, "/nowhere/session.igs.mha")


def test_the_list_of_a_procedure_is_the_players(tmp_path, sonoplay):
    case, session, stats = tmp_path / "a.sonocase", tmp_path / "line.igs.mha", tmp_path / "stats.json"
    subprocess.run([BIN / "core_write_case", case, tmp_path / "other.igs.mha", "procedure"], check=True)
    sonoplay(case, "--exercise", "line", "--tracker", "sweep:expert", "--record", session, "--stats", stats,
             "--headless")
    played = json.loads(stats.read_text())["procedure"]
    assert sonocase.score(sonocase.Case.open(case), session)["procedure"] == played
    ticked = {item["name"]: item["ticked"] for item in played["items"]}
    assert ticked == {"looked": True, "numbed": True, "drawn": True, "pressed": False, "deep": True, "asked": True}
    # The moments are those of the script: looked at for half a second, injected at 2 s, drawn at 3 s.
    done = {step["name"]: step["time_s"] for step in played["steps"]}
    assert done["look"] == pytest.approx(0.5, abs=0.1)
    assert (done["numb"], done["draw"]) == (pytest.approx(2, abs=0.05), pytest.approx(3, abs=0.05))
