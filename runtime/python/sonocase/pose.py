# SPDX-License-Identifier: Apache-2.0
"""Poses of probe and needle: 4 x 4 float64 arrays, mm, frame `mannequin`.

Of a probe: origin at the middle of its face, x along the face, y across it, z into the body.
Of a needle: origin at the tip, z from hub to tip.
"""

import numpy as np


def looking(point, beam, lateral=(1.0, 0.0, 0.0)):
    """The pose at `point` whose z is along `beam`, and whose x is as near to `lateral` as it can be."""
    z = np.asarray(beam, float)
    z = z / np.linalg.norm(z)
    x = np.asarray(lateral, float)
    x = x - (x @ z) * z
    if np.linalg.norm(x) < 1e-6:  # along the beam: any other will do
        x = np.eye(3)[np.argmin(np.abs(z))]
        x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = x, np.cross(z, x), z, point
    return pose


def on_skin(case, near, beam=None, lateral=(1.0, 0.0, 0.0), pressed_mm=0.0):
    """A probe set down on the skin, or None where there is none.

    near        a point above or below the skin
    beam        direction in which the skin is looked for and the probe looks; None: the skin's
                inward normal, looked for along the exercise's first beam
    pressed_mm  how far the face is pushed in along the beam
    """
    direction = case.exercise().start_pose[:3, 2] if beam is None else np.asarray(beam, float)
    point = case.skin_point(near, direction)
    if point is None:
        return None
    if beam is None:
        normal = case.skin_normal(point)
        if normal is None:
            return None
        direction = -normal
    direction = direction / np.linalg.norm(direction)
    return looking(point + pressed_mm * direction, direction, lateral)


def turned(pose, tilt_rad=0.0, rock_rad=0.0, rotate_rad=0.0):
    """The pose turned about its own axes: tilt about x (sweeps the plane), rock about y (within the
    plane), rotate about z (the beam), in this order."""
    result = np.array(pose, float)
    for axis, angle in ((2, rotate_rad), (1, rock_rad), (0, tilt_rad)):
        c, s = np.cos(angle), np.sin(angle)
        i, j = ((1, 2), (2, 0), (0, 1))[axis]
        turn = np.eye(3)
        turn[i, i] = turn[j, j] = c
        turn[i, j], turn[j, i] = -s, s
        result[:3, :3] = result[:3, :3] @ turn
    return result


def moved(pose, offset_mm):
    """The pose moved by `offset_mm` (3,) along its own axes."""
    result = np.array(pose, float)
    result[:3, 3] += result[:3, :3] @ np.asarray(offset_mm, float)
    return result


def inverse(pose):
    """probe_from_mannequin of mannequin_from_probe."""
    pose = np.asarray(pose, float)
    result = np.eye(4)
    result[:3, :3] = pose[:3, :3].T
    result[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return result
