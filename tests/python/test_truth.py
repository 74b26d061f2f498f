# SPDX-License-Identifier: Apache-2.0
"""Truth: against the label volume by numpy alone, and the same from Python and the player."""

import json

import numpy as np
import pytest

import sonocase
from pictures import read_png


def plane_points(renderer, pose):
    """Every pixel's place in `mannequin`, (h, w, 3), from the definition of the plane."""
    width, height = renderer.size
    u0, v0 = renderer.origin_px
    x = (np.arange(width) - u0) * renderer.mm_per_px
    z = (np.arange(height) - v0) * renderer.mm_per_px
    plane = np.zeros((height, width, 3))
    plane[..., 0], plane[..., 2] = x[None, :], z[:, None]
    return plane, plane @ pose[:3, :3].T + pose[:3, 3]


def test_labels_are_the_volume_s(case, pose):
    renderer = sonocase.Renderer(case, model="physical", effects=["-contact", "-deformation"],
                                 size=(180, 150))
    for tilt in (0, 0.3, -0.5):
        off_sides = sonocase.Pose.moved(pose, (0.1, 0.7, 0.3))  # of voxels
        turned = sonocase.Pose.turned(off_sides, tilt_rad=tilt, rotate_rad=2 * tilt)
        renderer.render(turned)
        planes, _ = renderer.truth()
        plane, points = plane_points(renderer, turned)
        probe = renderer.exercise.probe
        r = np.hypot(plane[..., 0], plane[..., 2] + probe.radius_mm) - probe.radius_mm
        angle = np.arctan2(plane[..., 0], plane[..., 2] + probe.radius_mm)
        edge = np.minimum(np.abs(r), np.abs(r - probe.depth_mm))
        scanned = (r > 0) & (r < probe.depth_mm) & (abs(angle) < probe.field_of_view_rad / 2)
        voxels = (points - case.origin_mm) / case.voxel_mm
        nearest = np.floor(voxels + 0.5).astype(int)
        inside = np.all((nearest >= 0) & (nearest < case.size), axis=-1)
        clipped = np.clip(nearest, 0, np.array(case.size) - 1)
        expected = case.label_volume()[clipped[..., 2], clipped[..., 1], clipped[..., 0]]
        expected = np.where(inside & scanned, expected, 0)
        # A voxel's side within 0.1 mm is as good as a surface here: this bundle has no others.
        away_mm = np.abs(voxels + 0.5 - np.round(voxels + 0.5)).min(axis=-1) * case.voxel_mm
        clear = (away_mm > 0.1) & (edge > 0.1)
        assert clear.mean() > 0.6
        np.testing.assert_array_equal(planes.labels[clear], expected[clear])
        np.testing.assert_array_equal(np.isnan(planes.skin_depth_mm[clear & ~scanned]), True)


def test_a_pixel_leads_to_its_tissue_at_rest_and_to_its_lesion(with_cyst, pose):
    case = sonocase.Case.open(with_cyst)
    renderer = sonocase.Renderer(case, "cyst", size=(160, 140))
    for press_mm in (0, 6):
        renderer.render(pose, time_s=1.3, press_mm=press_mm)
        planes, facts = renderer.truth(["labels", "lesions", "rest_mm"])
        assert planes.rest_mm.shape == (140, 160, 3)
        shown = ~np.isnan(planes.rest_mm[..., 0])
        rest = planes.rest_mm[shown].astype(float)
        # Places within 0.01 mm of a surface may fall on its other side in single precision.
        assert np.mean(np.array(case.labels_at(rest)) == planes.labels[shown]) > 0.998
        assert not planes.labels[~shown].any()
        target = renderer.exercise.targets[0]
        within = np.linalg.norm(rest - target.centre_mm, axis=-1) < target.radius_mm
        lesion = planes.lesions[shown] == facts["lesions"][0]["index"]
        assert np.mean(within == lesion) > 0.998 and lesion.sum() > 40
        assert facts["lesions"][0]["name"] == target.name and facts["lesions"][0]["kind"] == "cyst"
        assert facts["lesions"][0]["area_mm2"] == pytest.approx(lesion.sum() * renderer.mm_per_px**2)
        assert facts["targets"][0]["radius_mm"] == target.radius_mm
    renderer = sonocase.Renderer(case, "cyst", size=(160, 140), effects=["-targets"])
    renderer.render(pose)
    planes, facts = renderer.truth(["lesions"])
    assert not planes.lesions.any() and facts["lesions"] == []


def test_facts_of_a_needle_in_the_plane(case, pose):
    renderer = sonocase.Renderer(case, size=(512, 512))
    tip = pose[:3, 3] + 35 * pose[:3, 2]  # straight down the middle beam
    renderer.render(pose, (tip, pose[:3, 2]))
    planes, facts = renderer.truth()
    assert facts["tip"]["in_plane"]
    np.testing.assert_allclose(facts["tip"]["probe_mm"], [0, 0, 35], atol=1e-9)
    assert facts["targets"][0]["tip_mm"] == pytest.approx(np.linalg.norm(tip - [0, 0, 25]))
    assert (planes.needle == 2).any() and (planes.needle == 1).any()
    names = [organ["name"] for organ in facts["visible"]]
    assert names == ["muscle", "vessel"]
    for organ in facts["visible"]:
        area = (planes.labels == organ["index"]).sum() * renderer.mm_per_px**2
        assert organ["area_mm2"] == pytest.approx(area)
    aside = tip + 15 * pose[:3, 1]
    renderer.render(pose, (aside, pose[:3, 2]))
    assert not renderer.truth()[1]["tip"]["in_plane"]
    renderer.render(pose)
    assert renderer.truth()[1]["tip"] is None


def test_a_batch_s_truth_is_the_frames_one_by_one(case, pose):
    renderer = sonocase.Renderer(case, size=(90, 80))
    poses = np.stack([sonocase.Pose.moved(pose, (0, 3.0 * n, 0)) for n in range(5)])
    pictures, planes, facts = renderer.render_batch(
        poses, threads=3, truth=["labels", "shadowed", "skin_depth_mm"])
    assert planes.needle is None and len(facts) == 5
    for n in range(5):
        np.testing.assert_array_equal(renderer.render(poses[n], frame=n), pictures[n])
        alone, fact = renderer.truth()
        np.testing.assert_array_equal(alone.labels, planes.labels[n])
        np.testing.assert_array_equal(alone.shadowed, planes.shadowed[n])
        np.testing.assert_array_equal(alone.skin_depth_mm, planes.skin_depth_mm[n])
        assert [o["area_mm2"] for o in fact["visible"]] == [
            o["area_mm2"] for o in facts[n]["visible"]]


def test_the_player_writes_the_same(small, sonoplay, tmp_path):
    sonoplay(small[0], "--headless", "--frames", 3, "--size", "160x128", "--truth", tmp_path)
    case = sonocase.Case.open(small[0])
    renderer = sonocase.Renderer(case, size=(160, 128))
    lines = (tmp_path / "truth.jsonl").read_text().splitlines()
    assert len(lines) == 3
    for line in map(json.loads, lines):
        renderer.render(line["mannequin_from_probe"], line["mannequin_from_needle"],
                        line["time_s"])
        planes, facts = renderer.truth()
        read = lambda kind: read_png(tmp_path / f"{kind}_{line['frame']:05d}.png")
        assert read("labels").dtype == np.uint16
        np.testing.assert_array_equal(read("labels"), planes.labels)
        np.testing.assert_array_equal(read("needle"), planes.needle)
        np.testing.assert_array_equal(read("shadow"), planes.shadowed)
        # 0 stands for no depth alone: what lies before the skin is written as 0.01 mm.
        measured = ~np.isnan(planes.skin_depth_mm)
        np.testing.assert_array_equal(read("depth") > 0, measured)
        np.testing.assert_allclose(read("depth")[measured] / 100, np.maximum(planes.skin_depth_mm[measured], 0.01),
                                   atol=0.0051)
        assert [o["name"] for o in line["visible"]] == [o["name"] for o in facts["visible"]]
        assert line["tip"].keys() == facts["tip"].keys()
        for name in ("in_plane", "label", "name", "visible"):
            assert line["tip"][name] == facts["tip"][name]
        assert case.labels[facts["tip"]["label"]].name == facts["tip"]["name"]
        assert line["targets"][0]["tip_mm"] == pytest.approx(facts["targets"][0]["tip_mm"])


def test_bad_requests(case, pose):
    renderer = sonocase.Renderer(case, size=(32, 32))
    with pytest.raises(RuntimeError, match="no frame"):
        renderer.truth()
    renderer.render(pose)
    with pytest.raises(ValueError, match="no plane sparkle"):
        renderer.truth(["sparkle"])
    with pytest.raises(ValueError, match="ask for both"):
        renderer.truth(["shadowed"])
    planes, _ = renderer.truth(["labels"])
    assert planes.needle is None and planes.labels.shape == (32, 32)
