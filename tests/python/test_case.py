# SPDX-License-Identifier: Apache-2.0
"""What a case says about itself, and the scores of a session on it."""

import copy
import json
import os
import pathlib
import pickle
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


@pytest.mark.parametrize("name", [b"caf\xe9", "café".encode(), b"\xff\xfe  "])
def test_files_of_any_name_are_read(small, tmp_path, pose, name):
    """Names of files are bytes: os.fsencode and os.fsdecode say them as text, both ways."""
    folder = os.fsencode(tmp_path)
    case_path, session = os.path.join(folder, name + b".sonocase"), os.path.join(folder, name + b".igs.mha")
    for copied, path in zip(small, (case_path, session)):
        os.symlink(copied, path)
    text = os.fsdecode(case_path)
    for given in (case_path, text, pathlib.Path(text)):
        case = sonocase.Case.open(given)
        assert case.path == text and text in repr(case)
        renderer = sonocase.Renderer(case, size=(16, 16))
        again = pickle.loads(pickle.dumps((case, case.exercise(), renderer)))
        assert again[0].path == text and again[1].name == case.exercise().name
        np.testing.assert_array_equal(again[2].render(pose), renderer.render(pose))
    machine = os.path.join(folder, name + b".toml")
    with open(machine, "w") as file:
        file.write('[machine]\nbase = "modern"\n')
    for given in (machine, os.fsdecode(machine)):
        pickle.loads(pickle.dumps(sonocase.Renderer(case, machine=given, size=(16, 16))))
    for given in (session, os.fsdecode(session), pathlib.Path(os.fsdecode(session))):
        assert len(sonocase.read_session(given)["time_s"]) == 60
        assert sonocase.score(case, given)["targets"][0]["name"] == "vessel"
    missing = os.path.join(folder, name + b".none")
    for use in (sonocase.Case.open, sonocase.read_session, lambda path: sonocase.score(case, path)):
        with pytest.raises(sonocase.Error) as raised:
            use(missing)
        assert os.fsdecode(missing) in str(raised.value) and "no such file" in str(raised.value)
    case.close()
    with pytest.raises(sonocase.Error, match="the case is closed"):
        case.labels


def test_what_is_no_path_is_refused(case):
    for use in (sonocase.Case.open, sonocase.read_session, lambda path: sonocase.score(case, path),
                lambda path: sonocase.Renderer(case, machine=path)):
        for bad in ("a\0b", b"a\0b"):
            with pytest.raises(ValueError, match="no file's name has, as NUL"):
                use(bad)
        for bad in (None, 3, ["a"]):
            with pytest.raises(TypeError, match="give a path"):
                use(bad)


def test_pickles_know_the_folder_in_which_a_case_was_opened(small, tmp_path, monkeypatch, pose):
    monkeypatch.chdir(small[0].parent)
    case = sonocase.Case.open(small[0].name)
    (tmp_path / "mine.toml").write_text('[machine]\nbase = "modern"\n')
    machine = os.path.relpath(tmp_path / "mine.toml")
    ours = case, case.exercise(), sonocase.Renderer(case, machine=machine, size=(16, 16))
    monkeypatch.chdir(tmp_path)
    again = pickle.loads(pickle.dumps(ours))
    assert again[0].name == case.name
    np.testing.assert_array_equal(again[2].render(pose), ours[2].render(pose))


def test_everything_public_goes_through_a_pickle(case, pose):
    exercise = case.exercise("scan")
    renderer = sonocase.Renderer(case, size=(16, 16))
    renderer.render(pose, sonocase.Pose.looking((20, 0, 43), (-8, 0, -9)))
    planes, facts = renderer.truth()
    array = sonocase.Array((2, 3), "float32")
    np.asarray(array)[:] = [[1, 2, 3], [4, 5, float("inf")]]
    values = {"Array": array, "Case": case, "Error": sonocase.Error("a line"), "Exercise": exercise, "Label": case.labels[2],
              "Needle": sonocase.Needle(gauge=20), "Probe": sonocase.Probe(depth_mm=60), "Renderer": renderer,
              "Target": exercise.targets[0], "TruthPlanes": planes}
    assert set(values) == {name for name in sonocase.__all__ if isinstance(getattr(sonocase, name), type)}

    def seen(value):
        if isinstance(value, np.ndarray):
            return value.tolist()
        if type(value).__module__ != "sonocase._core":
            return value
        return {n: seen(getattr(value, n)) for n in dir(value)
                if isinstance(getattr(type(value), n, None), property) and n not in ("__array_interface__", "doppler", "skipped_effects")}
    for name, value in values.items():
        for again in (pickle.loads(pickle.dumps(value)), copy.deepcopy(value)):
            assert type(again) is type(value)
            if name == "Renderer":  # it goes without its frames
                again.render(pose, sonocase.Pose.looking((20, 0, 43), (-8, 0, -9)))
            np.testing.assert_equal(str(seen(again)), str(seen(value)))
    assert pickle.loads(pickle.dumps(array)).tolist() == array.tolist()
    assert pickle.loads(pickle.dumps(values["Error"])).args == ("a line",)
    np.testing.assert_equal(pickle.loads(pickle.dumps(facts)), facts)


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
