# SPDX-License-Identifier: Apache-2.0
"""Environments with the reset and step that reinforcement learners expect.

    env = sonocase.environment.Environment(case, "reach-target", seed=1)
    picture, info = env.reset()
    picture, reward, terminated, truncated, info = env.step(env.action_space.sample())

Follows the interface of Gymnasium (Farama Foundation): where it is installed, the classes are a
`gymnasium.Env` and a `gymnasium.vector.VectorEnv` and take its wrappers; otherwise they stand alone,
with spaces of the same members, and `gymnasium.make("sonocase/reach-target-v0", case=PATH)` knows
the tasks once this module is imported. `reset(seed=n)` begins the same episode again; `reset()` goes on and
draws another. The first `reset()` is a `reset(seed=n)` by the `seed` of the constructor; without one each
environment draws episodes of its own.

Tasks, and their actions (numbers from -1 to 1, each a part of the greatest step):

    find-view     6: slide x, slide y, tilt, rock, rotate, press. Show the target: its centre within
                  2 mm of the scan plane and inside the picture.
    keep-needle   6, of the probe: the needle advances by itself and drifts; keep its tip in the
                  plane. Ends when the tip has gone as deep as the target in the frame `probe`,
                  when it was out of the plane for 40 steps on end, or is over 40 mm off it.
    reach-target  10: the probe's, then the needle's advance, steer in the plane, steer across it,
                  and shift along the probe's face. Bring the tip to the target.

The observation is the picture: uint8 (height, width). `info` holds `contact` (share of beams that
touch the skin), `facts` (Renderer.truth, without what is NaN or None in a frame, but for `tip`) and,
where asked for, `planes`. Those of a VectorEnvironment are arrays with an entry per environment, and
beside each is a mask, `_contact`, `_facts` and `_planes`, as Gymnasium has them. With
render_mode="rgb_array", `render()` gives the picture in colour, (height, width, 3).
"""

import numpy as np

from . import pose as _pose
from ._core import Case, Error, Renderer
from .data import _PLANES, checked_planes

try:
    import gymnasium as _gymnasium
    from gymnasium.vector import VectorEnv as _VectorEnv
    _Env = _gymnasium.Env
    try:
        from gymnasium.vector import AutoresetMode
        _NEXT_STEP = AutoresetMode.NEXT_STEP
    except ImportError:  # before Gymnasium 1.1
        _NEXT_STEP = "NextStep"
except ImportError:
    _Env = _VectorEnv = object
    _NEXT_STEP = "NextStep"

TASKS = ("find-view", "keep-needle", "reach-target")
SLIDE_MM, TURN_RAD, PRESS_MM = 3.0, 0.05, 1.0
ADVANCE_MM, STEER_RAD, SHIFT_MM = 3.0, 0.05, 2.0
PRESSED_MM = (-2.0, 8.0)
FOUND_MM = 2.0
LOST_STEPS, LOST_MM = 40, 40.0  # keep-needle: out of the plane on end; away from it
STEPS_PER_S = 20


class Box:
    """A box of numbers: what is needed of gymnasium.spaces.Box where Gymnasium is not installed."""

    def __init__(self, low, high, shape, dtype=np.float32, seed=None):
        self.low, self.high = np.full(shape, low, dtype), np.full(shape, high, dtype)
        self.shape, self.dtype = tuple(shape), np.dtype(dtype)
        self.np_random = np.random.default_rng(seed)

    def seed(self, seed=None):
        """Begins sample() anew."""
        self.np_random = np.random.default_rng(seed)

    def sample(self):
        """A member, drawn evenly."""
        if self.dtype.kind in "ui":
            return self.np_random.integers(self.low, self.high, endpoint=True, dtype=self.dtype)
        return self.np_random.uniform(self.low, self.high).astype(self.dtype)

    def contains(self, x):
        """Whether an array is a member."""
        x = np.asarray(x)
        return x.shape == self.shape and bool(np.all((x >= self.low) & (x <= self.high)))


def _is_nan(fact):
    return isinstance(fact, float) and fact != fact


def _comparable(fact):
    """Facts that are equal when they repeat, and that Gymnasium can put side by side for several environments: it gives a
    number an array of numbers, which cannot hold the None of an environment that lacks it. What is not known is left out."""
    if isinstance(fact, dict):
        return {name: _comparable(value) for name, value in fact.items()
                if not _is_nan(value) and (value is not None or name == "tip")}
    if isinstance(fact, list):
        return [None if _is_nan(value) else _comparable(value) for value in fact]
    return fact


def _box(low, high, shape, dtype):
    try:
        from gymnasium.spaces import Box as Gymnasium
    except ImportError:
        return Box(low, high, shape, dtype)
    return Gymnasium(low, high, shape, dtype)


class _Episode:
    """One probe, and one needle where the task has one; knows nothing of pictures."""

    def __init__(self, case, exercise, task, longest):
        self.case, self.exercise, self.task, self.longest = case, exercise, task, longest
        if task not in TASKS:
            raise ValueError(f"task: no task {task}; give {', '.join(TASKS)}")
        if not exercise.targets:
            raise ValueError(f"exercise {exercise.name}: has no target; every task needs one")
        self.target = exercise.targets[0]
        # Above the target, where the exercise's sweeps or its beginning put the probe.
        stands = [p for name in exercise.sweeps for p in exercise.sweep_poses(name)]
        stands = stands or [exercise.start_pose]
        self.stand = min(stands, key=lambda p: np.linalg.norm(p[:3, 3] - self.target.centre_mm))

    def reset(self, random):
        self.random, self.steps, self.pressed, self.lost = random, 0, 0.0, 0
        self.time_s = random.uniform(0, 8)
        beam, lateral = self.stand[:3, 2], self.stand[:3, 0]
        for _ in range(50):
            near = self.stand[:3, 3] + self.stand[:3, :2] @ random.uniform(-25, 25, 2)
            self.pose = _pose.on_skin(self.case, near, beam, lateral)
            if self.pose is not None:
                break
        else:
            raise RuntimeError(f"exercise {self.exercise.name}: no skin where it begins")
        self.pose = _pose.turned(self.pose, *random.uniform(-0.3, 0.3, 3))
        self.needle = None
        if self.task != "find-view":
            angle = random.uniform(0.5, 0.9)
            across = random.uniform(-1, 1) if self.task == "keep-needle" else random.uniform(-4, 4)
            tip = (self.pose @ [-35.0, across, 5.0, 1.0])[:3]
            axis = self.pose[:3, :3] @ [np.sin(angle), 0.0, np.cos(angle)]
            self.needle = _pose.looking(tip, axis, self.pose[:3, 0])
        self.last = None

    def _move_probe(self, action):
        slide, turn, press = action[:2] * SLIDE_MM, action[2:5] * TURN_RAD, action[5] * PRESS_MM
        pose = _pose.moved(_pose.turned(self.pose, *turn), (slide[0], slide[1], -self.pressed))
        point = self.case.skin_point(pose[:3, 3], pose[:3, 2], 40.0)
        if point is None:  # off the body: it stays where it was
            return
        self.pressed = float(np.clip(self.pressed + press, *PRESSED_MM))
        pose[:3, 3] = point + self.pressed * pose[:3, 2]
        self.pose = pose

    def _move_needle(self, action):
        self.needle = _pose.turned(self.needle, rock_rad=action[1] * STEER_RAD,
                                   tilt_rad=action[2] * STEER_RAD)
        self.needle[:3, 3] += action[3] * SHIFT_MM * self.pose[:3, 0]
        self.needle[:3, 3] += action[0] * ADVANCE_MM * self.needle[:3, 2]

    def act(self, action):
        action = np.clip(action, -1, 1)
        self.steps += 1
        self.time_s += 1 / STEPS_PER_S
        self._move_probe(action[:6])
        if self.task == "reach-target":
            self._move_needle(action[6:])
        elif self.task == "keep-needle":
            drift = self.random.normal(0, 0.2, 2)
            self._move_needle(np.array([0.3, drift[0], drift[1], 0.0]))

    def judge(self, facts):
        """Reward and end after a frame."""
        target, tip = facts["targets"][0], facts["tip"]
        if self.task == "find-view":
            away, done = abs(target["plane_mm"]), False
            if target["in_image"]:
                done = away < FOUND_MM
            else:
                away += 20
        elif self.task == "reach-target":
            away = target["tip_mm"]
            done = away < self.target.hit_radius_mm
        else:
            away = abs(tip["probe_mm"][1])
            self.lost = 0 if tip["in_plane"] else self.lost + 1
            depth = (_pose.inverse(facts["mannequin_from_probe"]) @ [*target["centre_mm"], 1])[2]
            done = tip["probe_mm"][2] >= depth or self.lost >= LOST_STEPS or away > LOST_MM
        if self.task == "keep-needle":
            reward = 1.0 if tip["in_plane"] else -min(away / 10, 1.0)
        else:
            reward = 0.0 if self.last is None else (self.last - away) / 10
            reward += 10.0 if done else -0.01
        self.last = away
        return reward, done, self.steps >= self.longest


class VectorEnvironment(_VectorEnv):
    """Many environments that step together, their frames rendered on `threads` threads.

    cases     a Case or its path, or a list of them, which take turns
    count     environments
    seed      of the first reset() without one; None: another each time
    planes    names of truth planes for `info["planes"]`; see Renderer.truth
    longest   steps of an episode before it is cut off
    render_mode   None or "rgb_array"; see render()
    An environment whose episode ended begins a new one in the next step; its action is then not
    used. The pictures do not depend on `threads`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": STEPS_PER_S, "autoreset_mode": _NEXT_STEP}
    render_mode = None
    spec = None
    closed = False

    def __init__(self, cases, task="find-view", count=1, *, exercise=None, size=(128, 128), seed=None,
                 threads=1, longest=200, planes=(), model="", machine="", render_mode=None):
        cases = list(cases) if isinstance(cases, (list, tuple)) else [cases]
        if not cases:
            raise ValueError("cases: the list is empty: give at least one case")
        cases = [c if isinstance(c, Case) else Case.open(c) for c in cases]
        self.num_envs, self.threads, self.planes = int(count), threads, list(checked_planes(planes, _PLANES)[1:])
        if self.num_envs < 1:
            raise ValueError("count: give at least one")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode: no mode {render_mode}: give None or rgb_array")
        self.render_mode = render_mode
        # What is seeded is episodes and the noise of their frames; the tissue stays the same.
        self._renderers = [Renderer(c, exercise, model=model, machine=machine, size=size) for c in cases]
        self._of = np.arange(self.num_envs) % len(cases)
        self._episodes = [_Episode(cases[r], self._renderers[r].exercise, task, longest)
                          for r in self._of]
        self._pictures = np.zeros((self.num_envs, size[1], size[0]), np.uint8)
        self._ended = np.ones(self.num_envs, bool)
        self._streams(seed)
        numbers = 10 if task == "reach-target" else 6
        self.single_action_space = _box(-1, 1, (numbers,), np.float32)
        self.single_observation_space = _box(0, 255, (size[1], size[0]), np.uint8)
        self.action_space = _box(-1, 1, (self.num_envs, numbers), np.float32)
        self.observation_space = _box(0, 255, self._pictures.shape, np.uint8)

    def _streams(self, seed):
        try:
            sequence = np.random.SeedSequence(seed)
        except (TypeError, ValueError):
            raise ValueError(f"seed: {seed!r} is no seed: give None or a whole number from 0 on") from None
        self._random = [np.random.default_rng(s) for s in sequence.spawn(self.num_envs)]
        self._frame = int(sequence.generate_state(1)[0]) // 2 // self.num_envs  # seeds the noise
        self._begun = False

    def _refuse_closed(self):
        if self.closed:
            raise Error("environment: it is closed: make another one")

    def reset(self, *, seed=None, options=None):
        """Begins all episodes: (pictures, info). With a seed, those of that seed; otherwise the next."""
        self._refuse_closed()
        if seed is not None:
            if _VectorEnv is not object:
                super().reset(seed=seed)
            self._streams(seed)
        self._frame += 1
        for episode, random in zip(self._episodes, self._random):
            episode.reset(random)
        self._ended[:], self._begun = False, True
        info = self._observe()
        for n, episode in enumerate(self._episodes):
            episode.judge(info["facts"][n])
        return self._pictures.copy(), info

    def step(self, actions):
        """Moves all by their actions: (pictures, reward, terminated, truncated, info)."""
        self._refuse_closed()
        actions = np.asarray(actions, float)
        if actions.shape != self.action_space.shape:
            raise ValueError(f"actions: an array of shape {actions.shape}; "
                             f"give {self.action_space.shape}")
        fresh = self._ended.copy()
        bad = np.flatnonzero(np.isnan(actions).any(1) & ~fresh)
        if bad.size:
            raise ValueError(f"actions: that of environment {bad[0]} is not a number: give -1 to 1")
        for n, episode in enumerate(self._episodes):
            episode.reset(self._random[n]) if fresh[n] else episode.act(actions[n])
        self._frame, self._begun = self._frame + 1, True
        info = self._observe()
        judged = [episode.judge(info["facts"][n]) for n, episode in enumerate(self._episodes)]
        reward = np.array([0.0 if fresh[n] else j[0] for n, j in enumerate(judged)])
        terminated = np.array([j[1] for j in judged]) & ~fresh
        truncated = np.array([j[2] for j in judged]) & ~terminated & ~fresh
        self._ended = terminated | truncated
        return self._pictures.copy(), reward, terminated, truncated, info

    def _observe(self):
        facts, planes = np.empty(self.num_envs, object), np.empty(self.num_envs, object)
        for r, renderer in enumerate(self._renderers):
            mine = np.flatnonzero(self._of == r)
            if len(mine) == 0:
                continue
            episodes = [self._episodes[n] for n in mine]
            pictures, truth, said = renderer.render_batch(
                np.stack([e.pose for e in episodes]), [e.needle for e in episodes],
                [e.time_s for e in episodes], first_frame=self._frame * self.num_envs % 2**31,
                threads=self.threads, truth=self.planes)
            self._pictures[mine] = pictures
            for i, n in enumerate(mine):
                facts[n] = _comparable(said[i])
                planes[n] = {name: getattr(truth, name)[i] for name in self.planes}
        info = {"facts": facts, "planes": planes, "contact": np.array([f["contact"] for f in facts])}
        return {**info, **{f"_{name}": np.ones(self.num_envs, bool) for name in info}}

    def render(self):
        """The pictures as they are now, a tuple of arrays (height, width, 3); None without a render_mode."""
        self._refuse_closed()
        if self.render_mode is None:
            return None
        if not self._begun:
            raise RuntimeError("environment: no episode began; call reset()")
        return tuple(np.repeat(picture[..., None], 3, 2) for picture in self._pictures)

    def close(self, **_):
        """Frees the memory; nothing else can be done with it then."""
        self._renderers = []
        self.closed = True


class Environment(_Env):
    """One environment; the arguments of VectorEnvironment without `count`."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": STEPS_PER_S}
    render_mode = None
    spec = None

    def __init__(self, case, task="find-view", **options):
        self._all = VectorEnvironment(case, task, 1, **options)
        self.render_mode = self._all.render_mode
        self.action_space = self._all.single_action_space
        self.observation_space = self._all.single_observation_space

    @property
    def unwrapped(self):
        """Itself: what a wrapper of Gymnasium holds."""
        return self

    @staticmethod
    def _one(info):
        return {"facts": info["facts"][0], "planes": info["planes"][0],
                "contact": float(info["contact"][0])}

    def reset(self, *, seed=None, options=None):
        """Begins an episode: (picture, info). With a seed, the first of that seed; otherwise the next."""
        if _Env is not object:
            super().reset(seed=seed)
        pictures, info = self._all.reset(seed=seed, options=options)
        return pictures[0], self._one(info)

    def step(self, action):
        """Moves by an action: (picture, reward, terminated, truncated, info)."""
        self._all._refuse_closed()
        if self._all._ended[0]:
            raise RuntimeError("environment: the episode has ended, or none began; call reset()")
        pictures, reward, terminated, truncated, info = self._all.step(np.asarray(action)[None])
        return (pictures[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]),
                self._one(info))

    def render(self):
        """The picture as it is now, (height, width, 3); None without a render_mode."""
        pictures = self._all.render()
        return None if pictures is None else pictures[0]

    def close(self):
        """Frees the memory; nothing else can be done with it then."""
        self._all.close()


if _Env is not object:
    for _task in TASKS:
        _gymnasium.register(id=f"sonocase/{_task}-v0", kwargs={"task": _task},
                            entry_point="sonocase.environment:Environment")
