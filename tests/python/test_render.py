# SPDX-License-Identifier: Apache-2.0
"""Frames: the same pixels as the player's, in any order, by any number of threads."""

import json
import pathlib
import pickle
import re
import subprocess
import sys
import threading

import numpy as np
import pytest

import sonocase
from pictures import read_png


def test_nothing_of_the_pipeline_or_the_window_is_linked():
    module = pathlib.Path(sys.modules["sonocase._core"].__file__)
    libraries = subprocess.run(["ldd", module], capture_output=True, text=True, check=True).stdout
    for name in ("ITK", "vtk", "openvdb", "ceres", "OpenImageIO", "tbb", "glfw", "imgui", "GL.so",
                 "sqlite"):
        assert name not in libraries


@pytest.mark.parametrize("model", ["physical", "paper"])
def test_pixels_are_those_of_the_player(small, sonoplay, tmp_path, model, hard_case):
    path, _ = small
    # How a needle dents tissue depends on its past, which the player keeps: the truth says it.
    sonoplay(path, "--headless", "--frames", 12, "--size", "200x160", "--model", model,
             "--out", tmp_path / "out", "--truth", tmp_path / "truth")
    case = sonocase.Case.open(path)
    renderer = sonocase.Renderer(case, model=model, size=(200, 160))
    dented = other = 0
    for line in (tmp_path / "truth" / "truth.jsonl").read_text().splitlines():
        truth = json.loads(line)
        needle = truth["mannequin_from_needle"]
        dent = truth["tip"]["dent_mm"] if needle else None
        dented += dent is not None and any(dent)
        picture = renderer.render(truth["mannequin_from_probe"], needle, truth["time_s"],
                                  frame=truth["frame"], dent=dent)
        played = read_png(tmp_path / "out" / f"frame_{truth['frame']:05d}.png")
        other += np.count_nonzero(picture != played)
    assert dented > 0
    hard_case("pixels of twelve frames other than the player's", other)


def test_a_needles_dent_is_drawn_and_said(case, pose):
    renderer = sonocase.Renderer(case, model="physical", size=(120, 120))
    needle = sonocase.Pose.looking(sonocase.Pose.moved(pose, (0, 0, 12))[:3, 3], pose[:3, 2])
    still = renderer.render(pose, needle)
    np.testing.assert_array_equal(renderer.render(pose, needle, dent=(0, 0)), still)
    dented = renderer.render(pose, needle, dent=(2.5, 0.3))
    assert (dented != still).any()
    assert renderer.truth(["labels"])[1]["tip"]["dent_mm"] == (2.5, 0.3)
    batch = renderer.render_batch(np.stack([pose] * 2), [needle] * 2, dents=[None, (2.5, 0.3)])
    np.testing.assert_array_equal(batch[0], still)
    np.testing.assert_array_equal(renderer.render(pose, needle, frame=1, dent=(2.5, 0.3)), batch[1])
    for bad in ((1,), (1, float("nan")), 3):
        with pytest.raises(ValueError, match="dent"):
            renderer.render(pose, needle, dent=bad)
    with pytest.raises(ValueError, match="dents: give one per pose"):
        renderer.render_batch(np.stack([pose] * 2), [needle] * 2, dents=[None])


@pytest.mark.parametrize("mode", ["colour", "power", "pw", "m"])
def test_doppler_modes_are_those_of_the_player(flowing, sonoplay, tmp_path, mode):
    sonoplay(flowing, "--headless", "--frames", 6, "--size", "120x100", "--model", "physical",
             "--effects=-deformation", "--mode", mode, "--out", tmp_path / "out",
             "--truth", tmp_path / "truth")
    renderer = sonocase.Renderer(sonocase.Case.open(flowing), model="physical", size=(120, 100),
                                 effects=["-deformation"])
    aim = None
    for line in (tmp_path / "truth" / "truth.jsonl").read_text().splitlines():
        truth = json.loads(line)
        pose = truth["mannequin_from_probe"]
        aim = aim or renderer.aimed(pose)  # that of the first frame, as the player keeps it
        picture = renderer.render(pose, truth["mannequin_from_needle"], truth["time_s"],
                                  frame=truth["frame"], mode=mode, doppler=aim)
        np.testing.assert_array_equal(
            picture, read_png(tmp_path / "out" / f"frame_{truth['frame']:05d}.png"))
    if mode != "m":
        assert renderer.doppler["vessel"] == "vessel" if mode == "pw" \
            else renderer.doppler["blood_cells"] > 0


def test_doppler_settings_that_do_not_exist_are_refused(flowing, pose):
    renderer = sonocase.Renderer(sonocase.Case.open(flowing), size=(64, 64))
    with pytest.raises(ValueError, match="no mode triplex"):
        renderer.render(pose, mode="triplex")
    with pytest.raises(ValueError, match="no setting speed"):
        renderer.render(pose, mode="colour", doppler={"speed": 3})
    with pytest.raises(ValueError, match="scale_cm_s: nan is out of range: give 1 to 500"):
        renderer.render(pose, mode="colour", doppler={"scale_cm_s": float("nan")})
    assert renderer.render(pose, mode="colour").shape == (64, 64, 3)
    assert renderer.render(pose, mode="pw").shape == (96, 64, 3)


def test_a_batch_is_the_frames_one_by_one(case, pose):
    renderer = sonocase.Renderer(case, model="physical", size=(96, 80))
    poses = np.stack([sonocase.Pose.moved(pose, (0, 2.0 * n, 0)) for n in range(9)])
    times = np.linspace(0, 3, 9)
    needle = sonocase.Pose.looking((20, 0, 43), (-8, 0, -9))
    needles = [needle if n % 2 else None for n in range(9)]
    alone = np.stack([renderer.render(poses[n], needles[n], times[n], frame=5 + n)
                      for n in range(9)])
    for threads in (1, 2, 7):
        batch = renderer.render_batch(poses, needles, times, first_frame=5, threads=threads)
        np.testing.assert_array_equal(batch, alone)
    out = np.empty((9, 80, 96), np.uint8)
    assert renderer.render_batch(poses, needles, times, first_frame=5, out=out) is out
    np.testing.assert_array_equal(out, alone)


def test_a_needle_is_a_pose_or_a_tip_and_a_direction(case, pose):
    renderer = sonocase.Renderer(case, size=(96, 80))
    needle = sonocase.Pose.looking((20, 0, 43), (-8, 0, -9))
    with_pose = renderer.render(pose, needle)
    np.testing.assert_array_equal(with_pose, renderer.render(pose, (needle[:3, 3], needle[:3, 2])))
    assert (with_pose != renderer.render(pose)).any()


def test_poses_of_any_layout_give_the_same_picture(case, pose):
    renderer = sonocase.Renderer(case, size=(64, 64))
    picture = renderer.render(pose)
    np.testing.assert_array_equal(picture, renderer.render(np.asfortranarray(pose)))
    np.testing.assert_array_equal(picture, renderer.render(pose.tolist()))
    wide = np.zeros((8, 8))
    wide[::2, ::2] = pose
    np.testing.assert_array_equal(picture, renderer.render(wide[::2, ::2]))


def test_the_seed_and_the_frame_change_the_noise_alone(case, pose):
    first = sonocase.Renderer(case, model="paper", size=(64, 64))
    second = sonocase.Renderer(case, model="paper", size=(64, 64), seed=2)
    assert (first.render(pose) != second.render(pose)).any()
    assert (first.render(pose) != first.render(pose, frame=1)).any()
    np.testing.assert_array_equal(first.render(pose), first.render(pose, frame=0))


def test_contact_is_said(case, pose):
    renderer = sonocase.Renderer(case, size=(64, 64))
    renderer.render(pose)
    assert renderer.contact
    renderer.render(sonocase.Pose.moved(pose, (0, 0, -60)))
    assert not renderer.contact


def bad_poses():
    mirror = np.diag([-1.0, 1, 1, 1])
    skewed = np.eye(4)
    skewed[0, 1] = 0.1
    holed = np.eye(4)
    holed[0, 3] = np.nan
    flat = np.eye(4)
    flat[3, 0] = 1
    return [(mirror, ValueError, "mirrors"), (skewed, ValueError, "not a rigid motion"),
            (2 * np.eye(4), ValueError, "last row"), (holed, ValueError, "not finite"),
            (flat, ValueError, "last row"), (np.eye(3), ValueError, "(3, 3)"),
            (np.zeros((1, 4, 4)), ValueError, "(1, 4, 4)"), ("pose", TypeError, "type str"),
            (None, TypeError, "pose"), (np.eye(4, dtype=complex), TypeError, "complex"),
            ([[1, 2], [3]], (TypeError, ValueError), "pose")]


@pytest.mark.parametrize("bad, error, words", bad_poses())
def test_a_bad_pose_is_an_exception_of_one_line(case, bad, error, words):
    renderer = sonocase.Renderer(case, size=(32, 32))
    with pytest.raises(error) as raised:
        renderer.render(bad)
    assert words in str(raised.value) and "\n" not in str(raised.value)


def test_the_bad_pose_of_a_batch_is_named(case, pose, hard_case):
    renderer = sonocase.Renderer(case, size=(32, 32))
    poses = np.stack([pose] * 4)
    poses[2, 0, 0] = 7
    out = np.zeros((4, 32, 32), np.uint8)
    with pytest.raises(ValueError, match=r"poses\[2\]"):
        renderer.render_batch(poses, out=out)
    hard_case("pixels drawn of a batch with a pose that is none", np.count_nonzero(out))
    assert renderer.render_batch(np.empty((0, 4, 4))).shape == (0, 32, 32)
    with pytest.raises(ValueError, match="one number per pose"):
        renderer.render_batch(np.stack([pose] * 3), times_s=[0, 1])
    with pytest.raises(ValueError, match="one per pose"):
        renderer.render_batch(np.stack([pose] * 3), [None])


@pytest.mark.parametrize("out, error", [
    (np.zeros((32, 32)), TypeError), (np.zeros((32, 31), np.uint8), ValueError),
    (np.zeros((64, 64), np.uint8)[::2, ::2], TypeError), ([0], TypeError)])
def test_out_is_checked(case, pose, out, error):
    renderer = sonocase.Renderer(case, size=(32, 32))
    with pytest.raises(error, match="out"):
        renderer.render(pose, out=out)
    locked = np.zeros((32, 32), np.uint8)
    locked.flags.writeable = False
    with pytest.raises(ValueError, match="read-only"):
        renderer.render(pose, out=locked)


def test_errors_are_those_of_the_programs(small, sonoplay, tmp_path):
    missing = tmp_path / "missing.sonocase"
    with pytest.raises(sonocase.Error) as raised:
        sonocase.Case.open(missing)
    assert f"sonoplay: {raised.value}\n" == sonoplay(missing, "--headless", check=False).stderr
    cut = tmp_path / "cut.sonocase"
    cut.write_bytes(small[0].read_bytes()[:1000])
    with pytest.raises(sonocase.Error) as raised:
        sonocase.Case.open(cut)
    assert f"sonoplay: {raised.value}\n" == sonoplay(cut, "--headless", check=False).stderr
    case = sonocase.Case.open(small[0])
    with pytest.raises(sonocase.Error, match="no exercise named nothing"):
        sonocase.Renderer(case, "nothing")
    for wrong, words in ((dict(effects="glitter"), "glitter"), (dict(size=(0, 5)), "0 x 5"),
                         (dict(machine="toaster"), "toaster")):
        with pytest.raises(sonocase.Error, match=words):
            sonocase.Renderer(case, **wrong)
    with pytest.raises(ValueError, match="no model"):
        sonocase.Renderer(case, model="oil")
    with pytest.raises(TypeError):
        sonocase.Renderer(case, exercise=3)


def test_a_closed_case_says_so(small, pose):
    with sonocase.Case.open(small[0]) as case:
        renderer = sonocase.Renderer(case, size=(32, 32))
    assert case.closed
    for use in (lambda: renderer.render(pose), lambda: case.labels, lambda: case.label_volume(),
                lambda: renderer.render_batch(np.stack([pose] * 2)),
                lambda: sonocase.Renderer(case)):
        with pytest.raises(sonocase.Error, match="the case is closed"):
            use()


def test_one_renderer_is_for_one_thread_at_a_time(case, pose):
    renderer = sonocase.Renderer(case, size=(512, 512))
    poses = np.stack([pose] * 200)
    started, refused = threading.Event(), []

    def batch():
        started.set()
        renderer.render_batch(poses)

    thread = threading.Thread(target=batch)
    thread.start()
    started.wait()
    while thread.is_alive() and not refused:
        try:
            renderer.render(pose)
        except RuntimeError as error:
            refused.append(str(error))
            with pytest.raises(RuntimeError, match="another thread"):
                renderer.close()
    thread.join()
    assert refused and "another thread" in refused[0]
    renderer.render(pose)  # and works again


def test_ctrl_c_ends_a_batch(small, hard_case):
    """In a process of its own, whose interrupt comes from another thread while a batch runs."""
    program = f"""
import _thread, signal, sys, threading
import numpy as np, sonocase
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
case = sonocase.Case.open({str(small[0])!r})
pose = sonocase.Pose.on_skin(case, case.exercise().start_pose[:3, 3], (0, 0, -1))
renderer = sonocase.Renderer(case, size=(256, 256))
poses = np.stack([pose] * 100000)
out = np.empty((1, 256, 256), np.uint8)
try:
    threading.Thread(target=_thread.interrupt_main, daemon=True).start()
    for n in range(100000):
        renderer.render_batch(poses[:64], threads=2)
except KeyboardInterrupt:
    renderer.render(pose)
    sys.exit(42)
"""
    ended = [subprocess.run([sys.executable, "-c", program]).returncode for _ in range(3)]
    hard_case("of three batches, going on after Ctrl-C", sum(code != 42 for code in ended))


def test_pressing_gives_force_and_moves_what_truth_says(case, pose):
    renderer = sonocase.Renderer(case, size=(120, 120))
    rest = renderer.render(pose)
    assert not renderer.press["pressed"] and renderer.press["force_n"] == 0
    at_rest, _ = renderer.truth(["labels"])
    forces = []
    for press_mm in (3, 6, 9):
        pressed = renderer.render(pose, press_mm=press_mm)
        forces.append(renderer.press["force_n"])
        assert renderer.press["pressure_kpa"] > 0
    assert 0 < forces[0] < forces[1] < forces[2]
    assert (pressed != rest).any()
    planes, facts = renderer.truth(["labels"])
    assert facts["press"] == renderer.press
    assert (planes.labels != at_rest.labels).any()
    # Pressed by an argument or by the pose: the same face at the same place.
    deeper = sonocase.Pose.moved(pose, (0, 0, 9))
    np.testing.assert_array_equal(renderer.render(deeper), pressed)
    # A batch, one depth for all or one each.
    batch = renderer.render_batch(np.stack([pose, pose]), press_mm=[0, 9], first_frame=0)
    np.testing.assert_array_equal(batch[0], rest)
    for bad in (-1, 41, float("nan")):
        with pytest.raises(ValueError, match="press_mm: .*give 0 to 40"):
            renderer.render(pose, press_mm=bad)
    with pytest.raises(ValueError, match="press_mm: give one number, or one per pose"):
        renderer.render_batch(np.stack([pose, pose]), press_mm=[1, 2, 3])


def test_a_renderer_is_closed_by_itself_or_at_the_end_of_a_block(case, pose):
    with sonocase.Renderer(case, size=(32, 32)) as renderer:
        renderer.render(pose)
        assert not renderer.closed
    assert renderer.closed and not case.closed and renderer.size == (32, 32)
    renderer.close()  # again: nothing
    for use in (lambda: renderer.render(pose), lambda: renderer.truth(), lambda: renderer.mm_per_px,
                lambda: renderer.render_batch(np.stack([pose] * 2)), lambda: renderer.aimed(pose),
                lambda: renderer.render(pose, mode="colour"), lambda: pickle.dumps(renderer),
                lambda: renderer.skipped_effects):
        with pytest.raises(sonocase.Error, match="the renderer is closed"):
            use()
    assert sonocase.Renderer(case, size=(32, 32)).render(pose).any()


def test_a_renderer_goes_to_a_loaders_workers(small, case, pose, monkeypatch, tmp_path):
    """Each start method of multiprocessing pickles: the same pixels of whatever it was asked for."""
    exercise = case.exercise("scan")
    exercise.probe.depth_mm, exercise.needle.gauge, exercise.needle.make = 80, 14, "notched"
    machine = tmp_path / "mine.toml"
    machine.write_text('[machine]\nbase = "modern"\n[machine.grey]\nlevel = 55\n')
    monkeypatch.chdir(small[0].parent)
    opened = sonocase.Case.open(small[0].name)  # by a path that means something here alone
    needle = sonocase.Pose.looking((20, 0, 43), (-8, 0, -9))
    renderers = [sonocase.Renderer(opened, exercise, size=(48, 40), seed=3, effects=["all", "-haze"], looks=2),
                 sonocase.Renderer(opened, model="paper", size=(32, 32), scanlines=64, samples=100),
                 sonocase.Renderer(opened, "scan", sonocase.Probe(depth_mm=60), sonocase.Needle(gauge=20),
                                   machine=str(machine), renderer="reference", size=(24, 24))]
    expected = [renderer.render(pose, needle) for renderer in renderers]
    sent = pickle.dumps((renderers, opened, exercise, exercise.probe, exercise.needle))
    program = ("import pickle, sys; r, case, e, p, n = pickle.loads(sys.stdin.buffer.read()); import numpy as np; "
               f"pose, needle = np.array({pose.tolist()}), np.array({needle.tolist()}); "
               "assert e.probe.depth_mm == p.depth_mm == 80 and e.needle.gauge == n.gauge == 14 and n.make == 'notched'; "
               "assert case.name == 'cylinder' and r[2].exercise.probe.depth_mm == 60; "
               "sys.stdout.buffer.write(b''.join(x.render(pose, needle).tobytes() for x in r))")
    shown = subprocess.run([sys.executable, "-c", program], input=sent, capture_output=True, cwd="/")
    assert shown.returncode == 0, shown.stderr.decode()
    assert shown.stdout == b"".join(e.tobytes() for e in expected)
    small_copy = tmp_path / "gone.sonocase"
    small_copy.write_bytes(small[0].read_bytes())
    sent = pickle.dumps(sonocase.Renderer(sonocase.Case.open(small_copy), size=(16, 16)))
    small_copy.unlink()
    with pytest.raises(sonocase.Error, match="no such file.*gone.sonocase|gone.sonocase.*no such file"):
        pickle.loads(sent)


def test_needle_and_contrast_are_the_callers(case, pose):
    needle = sonocase.Pose.looking((20, 0, 43), (-8, 0, -9))
    shown = {}
    for name, chosen in (("own", None), ("thick", sonocase.Needle(gauge=8)), ("thin", sonocase.Needle(gauge=25)),
                         ("notched", sonocase.Needle(make="notched", gauge=8))):
        renderer = sonocase.Renderer(case, model="physical", needle=chosen, size=(96, 80))
        shown[name] = renderer.render(pose, needle)
        assert chosen is None or renderer.exercise.needle.gauge == chosen.gauge
    for a, b in (("thick", "thin"), ("thick", "notched"), ("own", "thick")):
        assert (shown[a] != shown[b]).any(), (a, b)
    own = case.exercise().needle
    own.diameter_mm = 3
    assert own.diameter_mm == 3
    own.gauge = 18
    assert own.diameter_mm == pytest.approx(1.27, abs=0.03)  # ISO 9626
    renderer = sonocase.Renderer(case, model="physical", size=(96, 80))
    narrow, standard, wide = (renderer.render(pose, dynamic_range_db=v) for v in (30, 60, 100))
    np.testing.assert_array_equal(standard, renderer.render(pose))
    inside = standard > 0
    # Fewer decibels from black to white: the same echoes lie further apart.
    assert narrow[inside].std() > standard[inside].std() > wide[inside].std()
    batch = renderer.render_batch(np.stack([pose]), dynamic_range_db=30)
    np.testing.assert_array_equal(batch[0], narrow)


@pytest.mark.parametrize("make, words", [
    (lambda: sonocase.Probe(depth_mm=-3), "depth_mm: -3 is out of range: give 1 to 500"),
    (lambda: sonocase.Probe(depth_mm=float("nan")), "depth_mm: nan is out of range"),
    (lambda: sonocase.Probe(focus_mm=-1), "focus_mm: -1 "), (lambda: sonocase.Probe(width_mm=0), "width_mm: 0 "),
    (lambda: sonocase.Probe(elevation_mm=-1), "elevation_mm: -1 "),
    (lambda: setattr(sonocase.Probe(), "frequency_mhz", 500), "frequency_mhz: 500 "),
    (lambda: setattr(sonocase.Probe(), "field_of_view_rad", 70), "field_of_view_rad: 70 "),
    (lambda: sonocase.Needle(gauge=3), "gauge: 3 is out of range: give 6 to 34"),
    (lambda: sonocase.Needle(length_mm=-1), "length_mm: -1 "), (lambda: sonocase.Needle(diameter_mm=-1), "diameter_mm: -1 "),
    (lambda: setattr(sonocase.Needle(), "make", "gold"), "no make gold; give one of chiba")])
def test_numbers_that_no_probe_or_needle_has_are_refused_where_they_are_given(make, words):
    with pytest.raises(ValueError) as raised:
        make()
    assert words in str(raised.value)


def test_a_pose_in_metres_is_refused(case, pose):
    renderer = sonocase.Renderer(case, size=(32, 32))
    metres = pose.copy()
    metres[:3, 3] /= 1000
    for use in (lambda: renderer.render(metres), lambda: renderer.render(metres, mode="colour")):
        with pytest.raises(ValueError, match="pose: .*millimetres, not in metres"):
            use()
    with pytest.raises(ValueError, match=r"poses\[1\]: .*millimetres"):
        renderer.render_batch(np.stack([pose, metres]))
    renderer.render(np.eye(4))  # a face at the very origin is somebody's choice
    needle = pose.copy()
    needle[:3, 3] += 30 * pose[:3, 2]
    renderer.render(pose, needle)
    needle[:3, 3] /= 1000
    tip = (needle[:3, 3], needle[:3, 2])
    for given in (needle, tip):
        for use in (lambda: renderer.render(pose, given), lambda: renderer.render(pose, given, mode="colour")):
            with pytest.raises(ValueError, match="^needle: .*millimetres, not in metres"):
                use()
        with pytest.raises(ValueError, match=r"^needles\[1\]: .*millimetres"):
            renderer.render_batch(np.stack([pose, pose]), [None, given])
    # A tip at the origin, or away from the probe, is one in millimetres.
    renderer.render(pose, (np.zeros(3), pose[:3, 2]))
    away = pose[:3, 3] / np.linalg.norm(pose[:3, 3])
    renderer.render(pose, (-1.5 * away, pose[:3, 2]))
    for bad in (10, 121, float("nan")):
        with pytest.raises(ValueError, match="dynamic_range_db: .*20 to 120"):
            renderer.render(pose, dynamic_range_db=bad)


def test_what_a_frame_did_without_is_said(case, pose):
    renderer = sonocase.Renderer(case, model="physical", size=(32, 32), effects=["all", "-parenchyma"])
    renderer.render(pose)
    skipped = renderer.skipped_effects
    assert skipped["parenchyma"] == "switched off" and all(isinstance(why, str) and why for why in skipped.values())


def test_a_batch_on_several_threads_says_what_its_last_frame_did_without(case, pose):
    renderer = sonocase.Renderer(case, model="physical", size=(64, 48))
    poses = np.stack([sonocase.Pose.moved(pose, (0, 2.0 * n, 0)) for n in range(6)])
    needles = [None] * 5 + [sonocase.Pose.looking((20, 0, 43), (-8, 0, -9))]
    for order in (needles, needles[::-1]):
        renderer.render_batch(poses, order, threads=3)
        found = renderer.skipped_effects
        renderer.render(poses[-1], order[-1], frame=5)
        assert found == renderer.skipped_effects


@pytest.mark.parametrize("use", [
    lambda case, pose: sonocase.Renderer(None), lambda case, pose: sonocase.Renderer(None, "scan"),
    lambda case, pose: sonocase.Pose.on_skin(None, pose[:3, 3]), lambda case, pose: sonocase.score(None, "x"),
    lambda case, pose: sonocase.Renderer(case, size=(16, 16)).render(None)])
def test_none_in_place_of_ours_is_a_type_error(case, pose, use):
    with pytest.raises(TypeError):
        use(case, pose)


def test_no_method_and_no_property_takes_none_for_its_object():
    """Without an object there is nothing to read: a process that crashes here has no test that fails."""
    program = """
import sonocase
for kind in (k for k in vars(sonocase).values() if isinstance(k, type) and k.__module__ == "sonocase._core"):
    for name, member in vars(kind).items():
        use = member.fget if isinstance(member, property) else member
        if not callable(use) or name in ("__class__", "__new__"):
            continue
        try:
            use(None)
            assert name == "__enter__", (kind, name)
        except (TypeError, KeyError, sonocase.Error):
            pass
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


LIMITS = sonocase._core._LIMITS
OF_A_RENDERER = ("scanlines", "samples", "looks")
OF_A_FRAME = ("gain_db", "dynamic_range_db", "press_mm")


def beyond(name, sign):
    low, high = LIMITS[name]
    step = 2 if name == "looks" else 1 if isinstance(low, int) else 0.01 * (high - low)
    return high + step if sign > 0 else low - step


@pytest.mark.parametrize("name", [*OF_A_RENDERER, *OF_A_FRAME])
def test_limits_hold_and_one_beyond_is_refused(case, pose, name):
    low, high = LIMITS[name]
    renderer = sonocase.Renderer(case, size=(16, 16))

    def use(value):
        if name in OF_A_FRAME:
            renderer.render(pose, **{name: value})
            renderer.render_batch(np.stack([pose]), **{name: value})
        else:
            sonocase.Renderer(case, size=(16, 16), **{name: value}).render(pose)
    for value in (low, high, *([0] if name in OF_A_RENDERER else [])):
        use(value)
    for value in (beyond(name, -1), beyond(name, 1)):
        with pytest.raises(ValueError, match=f"{name}: .*out of range: give {low:g} to {high:g}"):
            use(value)


def test_a_dent_is_within_its_limits(case, pose):
    low, high = LIMITS["dent_mm"]
    renderer = sonocase.Renderer(case, size=(16, 16))
    needle = sonocase.Pose.looking(sonocase.Pose.moved(pose, (0, 0, 12))[:3, 3], pose[:3, 2])
    for dent in ((low, high), (high, low)):
        renderer.render(pose, needle, dent=dent)
    for dent in ((beyond("dent_mm", -1), 0), (0, beyond("dent_mm", 1)), (-1, 0), (float("nan"), 0)):
        with pytest.raises(ValueError, match="dent: .*give 0 to 50"):
            renderer.render(pose, needle, dent=dent)
        with pytest.raises(ValueError, match=r"dents\[0\]: .*give 0 to 50"):
            renderer.render_batch(np.stack([pose]), [needle], dents=[dent])


def test_the_limits_are_those_of_the_programs(sonoplay):
    from sonocase import domain
    said = " ".join(sonoplay("--help").stdout.split())
    for option, name in [("press", "press_mm"), ("angle", "angle_deg"), ("steer", "steer_deg"), ("scale", "scale_cm_s"),
                         ("spectral-scale", "spectral_scale_cm_s"), ("doppler-gain", "doppler_gain_db"),
                         ("diameter", "diameter_mm"), *((n.replace("_", "-"), n) for n in (
                             "scanlines", "samples", "looks", "threads", "baseline", "wall_filter", "priority", "ensemble"))]:
        low, high = LIMITS[name]
        assert re.search(rf"--{option} (INT|FLOAT):(INT|FLOAT) (bounded to|in) \[{low:g} - {high:g}\]", said), name
    for key, name in [("gain_db", "gain_db"), ("dynamic_range_db", "dynamic_range_db"), ("pose.press_mm", "press_mm"),
                      ("needle.tent_mm", "dent_mm"), ("needle.drag_mm", "dent_mm")]:
        assert domain._SAMPLE[key][1:] == LIMITS[name]


@pytest.mark.parametrize("name", [n for n in LIMITS if n not in (*OF_A_RENDERER, *OF_A_FRAME, "dent_mm", "threads")])
def test_doppler_settings_are_within_their_limits(flowing, pose, name):
    renderer = sonocase.Renderer(sonocase.Case.open(flowing), size=(16, 16))
    low, high = LIMITS[name]
    box = {"box_left": 0, "box_right": 1, "box_top_mm": 0, "box_bottom_mm": 500}
    for value in (low, high):
        given = {**(box if name in box else {}), name: value}
        if value == box.get({"box_left": "box_right", "box_right": "box_left", "box_top_mm": "box_bottom_mm",
                             "box_bottom_mm": "box_top_mm"}.get(name)):
            continue  # a box without an area
        renderer.render(pose, mode="colour", doppler=given)
        renderer.render(pose, mode="pw", doppler=given)
    for value in (beyond(name, -1), beyond(name, 1), float("nan")):
        if isinstance(low, int) and value != value:
            continue
        for mode in ("b", "colour"):
            with pytest.raises(ValueError, match=f"doppler: {name}: .*give {low:g} to {high:g}"):
                renderer.render(pose, mode=mode, doppler={name: value})


def test_a_doppler_box_has_an_area(flowing, pose):
    renderer = sonocase.Renderer(sonocase.Case.open(flowing), size=(16, 16))
    for given, words in (({"box_left": 0.8, "box_right": 0.2}, "box_left 0.8 is not below box_right 0.2"),
                         ({"box_left": 0.9}, "box_right 0.75; give both"),
                         ({"box_top_mm": 30, "box_bottom_mm": 30}, "box_top_mm 30 is not below box_bottom_mm 30")):
        with pytest.raises(ValueError, match=words):
            renderer.render(pose, mode="colour", doppler=given)
    renderer.render(pose, mode="colour", doppler=renderer.aimed(pose))


def test_what_is_said_of_the_last_frame_is_of_one_frame(flowing, pose):
    renderer = sonocase.Renderer(sonocase.Case.open(flowing), model="physical", size=(48, 48), effects=["all"])
    away = sonocase.Pose.moved(pose, (0, 0, -60))

    def said():
        return renderer.contact, renderer.press, renderer.truth(["labels"])[1]["contact"] > 0

    no_doppler = "the last frame was of no Doppler mode"
    renderer.render(pose, press_mm=5)
    assert renderer.contact and renderer.press["force_n"] > 0 and said()[2]
    with pytest.raises(RuntimeError, match=no_doppler):
        renderer.doppler
    renderer.render(pose, mode="colour")
    assert renderer.doppler["cells"] > 0
    before, measured = said(), renderer.doppler
    for refused in (lambda: renderer.render(away, mode="pw", doppler={"nope": 1}), lambda: renderer.render(away, mode="nope"),
                    lambda: renderer.render(away, out=[0]), lambda: renderer.render(away, mode="pw", out=[0]),
                    lambda: renderer.render(away, mode="pw", gain_db="x"), lambda: renderer.render_batch(np.stack([away]), out=[0])):
        with pytest.raises((ValueError, TypeError)):
            refused()
        assert said() == before and renderer.doppler == measured
    renderer.render_batch(np.stack([pose, away]), threads=2)
    assert not renderer.contact and not said()[2] and renderer.press["force_n"] == 0
    with pytest.raises(RuntimeError, match=no_doppler):
        renderer.doppler
    renderer.render(pose, mode="pw")
    assert "psv_cm_s" in renderer.doppler
    renderer.render_batch(np.stack([away, pose]), press_mm=5)
    assert renderer.contact and said()[2] and renderer.press["force_n"] > 0
    with pytest.raises(RuntimeError, match=no_doppler):
        renderer.doppler
    renderer.render_batch(np.empty((0, 4, 4)))  # no frame at all
    assert renderer.contact


@pytest.mark.parametrize("kind, words, use", [
    (TypeError, "effects: of type int", lambda case, pose: sonocase.Renderer(case, effects=3)),
    (TypeError, "effects: of type int", lambda case, pose: sonocase.Renderer(case, effects=[3])),
    (TypeError, "size: ", lambda case, pose: sonocase.Renderer(case, size=512)),
    (TypeError, "size: ", lambda case, pose: sonocase.Renderer(case, size="64")),
    (TypeError, "size: of type float", lambda case, pose: sonocase.Renderer(case, size=(64.5, 64))),
    (ValueError, "seed: -1 is out of range", lambda case, pose: sonocase.Renderer(case, seed=-1)),
    (ValueError, "seed: .*out of range", lambda case, pose: sonocase.Renderer(case, seed=2**32)),
    (ValueError, "seed: .*too large", lambda case, pose: sonocase.Renderer(case, seed=10**30)),
    (TypeError, "seed: of type str", lambda case, pose: sonocase.Renderer(case, seed="1")),
    (TypeError, "model: of type int", lambda case, pose: sonocase.Renderer(case, model=1)),
    (TypeError, "machine: of type int", lambda case, pose: sonocase.Renderer(case, machine=1)),
    (TypeError, "probe: give a sonocase.Probe", lambda case, pose: sonocase.Renderer(case, probe=3)),
    (TypeError, "needle: give a sonocase.Needle", lambda case, pose: sonocase.Renderer(case, needle=sonocase.Probe())),
    (TypeError, "looks: of type float", lambda case, pose: sonocase.Renderer(case, looks=1.5)),
    (TypeError, "time_s: of type str", lambda case, pose: sonocase.Renderer(case, size=(8, 8)).render(pose, time_s="x")),
    (TypeError, "frame: of type float", lambda case, pose: sonocase.Renderer(case, size=(8, 8)).render(pose, frame=0.5)),
    (TypeError, "mode: of type int", lambda case, pose: sonocase.Renderer(case, size=(8, 8)).render(pose, mode=1)),
    (TypeError, "doppler: give a dict", lambda case, pose: sonocase.Renderer(case, size=(8, 8)).render(pose, doppler=[1])),
    (TypeError, "doppler: gate_mm: of type str",
     lambda case, pose: sonocase.Renderer(case, size=(8, 8)).render(pose, mode="pw", doppler={"gate_mm": "x"})),
    (TypeError, "doppler: ensemble: of type float",
     lambda case, pose: sonocase.Renderer(case, size=(8, 8)).render(pose, mode="pw", doppler={"ensemble": 8.5})),
    (TypeError, "doppler: invert: of type str",
     lambda case, pose: sonocase.Renderer(case, size=(8, 8)).render(pose, mode="pw", doppler={"invert": "no"})),
    (TypeError, "truth: of type str",
     lambda case, pose: sonocase.Renderer(case, size=(8, 8)).render_batch(np.stack([pose]), truth="labels")),
    (TypeError, "threads: of type float",
     lambda case, pose: sonocase.Renderer(case, size=(8, 8)).render_batch(np.stack([pose]), threads=1.5))])
def test_an_argument_of_a_wrong_type_is_named(case, pose, kind, words, use):
    with pytest.raises(kind, match=f"^{words}") as raised:
        use(case, pose)
    assert "\n" not in str(raised.value)


def test_the_exercise_of_another_case_is_refused(case, small, flowing, tmp_path, monkeypatch):
    other = sonocase.Case.open(flowing)
    for use in (lambda: sonocase.Renderer(case, other.exercise(), size=(8, 8)),
                lambda: sonocase.score(case, small[1], other.exercise())):
        with pytest.raises(ValueError, match="exercise: .* is of the case .*flowing.*; give one of this case"):
            use()
    # The same file by another name, and one that has gone to another process, are this case's.
    link = tmp_path / "link.sonocase"
    link.symlink_to(small[0])
    monkeypatch.chdir(tmp_path)
    for exercise in (sonocase.Case.open("link.sonocase").exercise(), pickle.loads(pickle.dumps(case.exercise()))):
        sonocase.Renderer(case, exercise, size=(8, 8))
