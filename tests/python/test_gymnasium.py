# SPDX-License-Identifier: Apache-2.0
"""Environments as Gymnasium sees them: its own checks where it is installed, and what they ask for with a stand-in that has
its classes, so that these are tried on machines without it."""

import subprocess
import sys

import numpy as np
import pytest

from sonocase.environment import TASKS, Environment, VectorEnvironment


def same(a, b):
    """Gymnasium's data_equivalence: what check_env compares after the same seed and action."""
    if type(a) is not type(b):
        return False
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, np.ndarray):
        return a.shape == b.shape and bool(np.allclose(a, b, atol=1e-5))
    return a == b


@pytest.mark.parametrize("task", TASKS)
def test_reset_and_step_repeat_to_the_last_fact(case, task):
    env = Environment(case, task, size=(32, 32), planes=["labels"])
    runs = []
    for _ in range(2):
        picture, info = env.reset(seed=123, options={})
        step = env.step(np.full(env.action_space.shape, 0.5, np.float32))
        runs.append((picture, info, step))
    assert same(runs[0], runs[1])
    assert isinstance(runs[0][1], dict) and len(runs[0][2]) == 5


def unknown(facts):
    """Names of dictionaries' entries that hold nothing: Gymnasium's vector environments put a number's place at an array of
    numbers, which takes no None."""
    if isinstance(facts, list):
        return [name for fact in facts for name in unknown(fact)]
    if not isinstance(facts, dict):
        return []
    return [name for name, fact in facts.items() if fact is None or isinstance(fact, float) and fact != fact] + [
        name for fact in facts.values() for name in unknown(fact)]


@pytest.mark.parametrize("task", TASKS)
def test_what_is_not_known_is_left_out_of_the_facts(case, task):
    _, info = VectorEnvironment(case, task, 2, size=(32, 32)).reset()
    assert set(unknown(list(info["facts"]))) <= {"tip"}  # of a task without a needle in all its environments


STAND_IN = {
    "__init__.py": """
class Env:
    metadata, render_mode, spec, _np_random = {"render_modes": []}, None, None, None
    def reset(self, *, seed=None, options=None):
        if seed is not None:
            import numpy
            self._np_random = numpy.random.default_rng(seed)
    @property
    def unwrapped(self):
        return self
registry = {}
def register(id, entry_point=None, kwargs=None):
    registry[id] = (entry_point, kwargs or {})
def make(id, **more):
    import importlib
    entry, kwargs = registry[id]
    module, name = entry.split(":")
    return getattr(importlib.import_module(module), name)(**{**kwargs, **more})
from . import spaces, vector
""",
    "spaces.py": """
import numpy
class Space: pass
class Box(Space):
    def __init__(self, low, high, shape, dtype):
        self.low, self.high, self.shape, self.dtype = low, high, tuple(shape), numpy.dtype(dtype)
    def sample(self):
        return numpy.zeros(self.shape, self.dtype)
    def contains(self, x):
        return x.shape == self.shape and x.dtype == self.dtype and bool(((x >= self.low) & (x <= self.high)).all())
""",
    "vector.py": """
import enum
class AutoresetMode(enum.Enum):
    NEXT_STEP, SAME_STEP, DISABLED = "NextStep", "SameStep", "Disabled"
class VectorEnv:
    metadata, spec, render_mode, closed, _np_random = {}, None, None, False, None
    def reset(self, *, seed=None, options=None):
        if seed is not None:
            import numpy
            self._np_random = numpy.random.default_rng(seed)
""",
}
PROGRAM = """
import sys, inspect, numpy, gymnasium, sonocase
from sonocase.environment import Environment, VectorEnvironment
case = sonocase.Case.open(sys.argv[1])
env = gymnasium.make("sonocase/reach-target-v0", case=sys.argv[1], size=(32, 32))
assert isinstance(env, gymnasium.Env) and env.unwrapped is env and type(env) is Environment
assert isinstance(env.action_space, gymnasium.spaces.Space) and isinstance(env.observation_space, gymnasium.spaces.Space)
assert inspect.signature(env.reset).parameters["seed"].default is None
states = []
for _ in range(2):
    picture, info = env.reset(seed=123)
    states.append(env.unwrapped._np_random.bit_generator.state)
    assert env.observation_space.contains(picture) and isinstance(info, dict)
assert states[0] == states[1]
picture, reward, terminated, truncated, info = env.step(env.action_space.sample())
assert env.observation_space.contains(picture) and isinstance(reward, float)
assert isinstance(terminated, bool) and isinstance(truncated, bool)
env.close()
many = VectorEnvironment(case, "find-view", 3, size=(32, 32), longest=2)
assert isinstance(many, gymnasium.vector.VectorEnv) and many.num_envs == 3
assert many.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.NEXT_STEP
assert many.single_action_space.shape == (6,) and many.action_space.shape == (3, 6)
picture, info = many.reset(seed=1)
assert many.observation_space.contains(picture)
ended = []
for _ in range(3):
    picture, reward, terminated, truncated, info = many.step(many.action_space.sample())
    assert many.observation_space.contains(picture)
    assert reward.shape == terminated.shape == truncated.shape == (3,)
    ended.append(terminated | truncated)
assert ended[1].all() and not ended[2].any()
many.close()
assert many.closed
"""


def test_the_classes_are_those_of_gymnasium_where_there_is_one(small, tmp_path):
    for name, text in STAND_IN.items():
        path = tmp_path / "gymnasium" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    program = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{PROGRAM}"
    done = subprocess.run([sys.executable, "-c", program, small[0]], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_its_own_checks_pass(case, small):
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env
    for task in TASKS:
        check_env(Environment(case, task, size=(48, 40), render_mode="rgb_array"), skip_render_check=True)
    env = gymnasium.make("sonocase/find-view-v0", case=str(small[0]), size=(32, 32), max_episode_steps=3)
    env = gymnasium.wrappers.RecordEpisodeStatistics(env)
    env.reset(seed=1)
    assert [env.step(env.action_space.sample())[3] for _ in range(3)][-1]
    many = gymnasium.wrappers.vector.RecordEpisodeStatistics(VectorEnvironment(case, "find-view", 2, size=(32, 32), longest=2))
    many.reset(seed=1)
    ends = [many.step(many.action_space.sample())[4] for _ in range(2)]
    assert "episode" in ends[-1]
