# SPDX-License-Identifier: Apache-2.0
"""Poses of probe and needle: 4 x 4 float64 arrays, mm, frame `mannequin`.

Of a probe: origin at the middle of its face, x along the face, y across it, z into the body.
Of a needle: origin at the tip, z from hub to tip.
"""

from ._core import pose as _pose

inverse = _pose.inverse
looking = _pose.looking
moved = _pose.moved
on_skin = _pose.on_skin
turned = _pose.turned
