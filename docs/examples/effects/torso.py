# SPDX-License-Identifier: Apache-2.0
"""A torso to look at: views named by anatomy, each drawn with and without an effect.

Works on every case whose labels bear the names of TotalSegmentator, such as scenarios/real-torso.
"""

import numpy as np

import sonocase

FAN = dict(shape="curvilinear", depth_mm=150)
LINEAR = dict(shape="linear", width_mm=40, frequency_mhz=8, focus_mm=25, elevation_mm=2, depth_mm=50)


class Torso:
    def __init__(self, case):
        self.case = case
        self.volume = case.label_volume()[::2, ::2, ::2]
        self.names = [label.name for label in case.labels]
        up = self.middle("vertebrae_T12") - self.middle("vertebrae_L5")
        left = self.middle("kidney_left") - self.middle("kidney_right")
        self.head = up / np.linalg.norm(up)
        left -= (left @ self.head) * self.head
        self.left = left / np.linalg.norm(left)
        front = np.cross(self.left, self.head)
        self.front = front if front @ (self.middle("urinary_bladder") - self.middle("vertebrae_L5")) > 0 else -front

    def middle(self, name):
        if name not in self.names:
            raise LookupError(f"the case has no label {name}")
        voxels = np.argwhere(self.volume == self.names.index(name))[:, ::-1]
        return self.case.origin_mm + 2 * self.case.voxel_mm * voxels.mean(axis=0)

    def direction(self, towards):
        """(head, left, front) as a vector of the frame `mannequin`."""
        return towards[0] * self.head + towards[1] * self.left + towards[2] * self.front

    def view(self, label, seen_from, along, probe=FAN, aside_mm=(0, 0, 0), pressed_mm=4, **how):
        """The middle of a label (or a place `aside_mm` of it) seen from a side, the face `along` a direction.

        Directions are (head, left, front). how: what Renderer and its render() take.
        """
        aim = self.middle(label) + self.direction(aside_mm)
        beam = -self.direction(seen_from) / np.linalg.norm(seen_from)
        skin = self.case.skin_point(aim, beam, 200)
        return View(self, sonocase.Pose.looking(skin + pressed_mm * beam, beam, self.direction(along)), probe, how)


class View:
    OF_RENDERER = ("exercise", "machine", "model", "looks", "size")

    def __init__(self, torso, pose, probe, how):
        self.torso, self.pose, self.probe, self.how = torso, pose, probe, how

    def draw(self, effects="auto", **how):
        """A frame. Afterwards `truth` and `facts` say what it shows, `skipped` what it did without, and why."""
        how = {"exercise": "liver-biopsy", "size": (300, 300), "frame": 3, **self.how, **how}
        probe = self.probe if isinstance(self.probe, sonocase.Probe) else sonocase.Probe(**self.probe)
        renderer = sonocase.Renderer(self.torso.case, probe=probe, effects=effects,
                                     **{k: how.pop(k) for k in self.OF_RENDERER if k in how})
        picture = renderer.render(how.pop("pose", self.pose), **how)
        self.truth, self.facts = renderer.truth()
        self.skipped = renderer.skipped_effects
        self.mm_per_px, self.origin_px = renderer.mm_per_px, np.array(renderer.origin_px)
        return picture

    def pair(self, effect, **how):
        """With the effect, which must have run, and without it."""
        without = self.draw(f"-{effect}", **how)
        picture = self.draw("auto", **how)
        if effect in self.skipped:
            raise LookupError(f"{effect} does not run here: {self.skipped[effect]}")
        return picture, without

    def area_of(self, *names):
        """Pixels of the last frame that show these labels, or labels of these tissues."""
        of = [i for i, label in enumerate(self.torso.case.labels) if label.name in names or label.tissue in names]
        return np.isin(self.truth.labels, of)

    @property
    def scanned(self):
        return ~np.isnan(self.truth.skin_depth_mm)

    def depth(self, least_mm, most_mm=np.inf):
        """Pixels of the last frame between two depths below the skin."""
        with np.errstate(invalid="ignore"):
            return (self.truth.skin_depth_mm >= least_mm) & (self.truth.skin_depth_mm < most_mm)

    def near(self, point_mm, radius_mm):
        """Pixels of the last frame within a distance of a point's foot in the plane."""
        foot = (np.linalg.inv(self.pose) @ (*point_mm, 1))[[0, 2]] / self.mm_per_px + self.origin_px
        rows, columns = np.indices(self.scanned.shape)
        return np.hypot(columns - foot[0], rows - foot[1]) < radius_mm / self.mm_per_px


# Views that several effects share.
def liver(torso, **how):
    return torso.view("liver", (-0.1, -0.75, 0.65), (0, 1, 0), aside_mm=(-15, 0, 0), **how)


def kidney(torso, **how):
    return torso.view("kidney_right", (0, -0.9, 0.35), (1, 0, 0), **how)


def bladder(torso, **how):
    return torso.view("urinary_bladder", (0.25, 0, 1), (1, 0, 0), dict(FAN, depth_mm=180), **how)


def rib(torso, **how):
    return torso.view("rib_right_9", (0, -1, 0.2), (1, 0, 0.1), LINEAR, pressed_mm=1, **how)


def back(torso, **how):
    return torso.view("autochthon_right", (0, -0.1, -1), (1, 0, 0), LINEAR, pressed_mm=1, **how)


def groin(torso, **how):
    return torso.view("iliac_artery_left", (-0.3, 0.1, 1), (0, 1, 0), dict(LINEAR, depth_mm=60),
                      aside_mm=(-74, 28, 16), pressed_mm=1, **how)


def changed(on, off, where, elsewhere=None):
    """Mean change in grey in an area and in another, by default in the rest of the picture."""
    change = np.abs(on.astype(float) - off)
    rest = ~where if elsewhere is None else elsewhere
    return change[where].mean(), change[rest].mean()
