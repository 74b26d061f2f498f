# SPDX-License-Identifier: Apache-2.0
"""Environments: the interface, determinism, and tasks that a simple rule can solve."""

import subprocess
import sys

import numpy as np
import pytest

import sonocase
from sonocase.environment import TASKS, Environment, VectorEnvironment


@pytest.mark.parametrize("task", TASKS)
def test_reset_and_step_have_the_shape_that_learners_expect(case, task):
    env = Environment(case, task, size=(48, 40), longest=5, planes=["labels"])
    with pytest.raises(RuntimeError, match="reset"):
        env.step(env.action_space.sample())
    picture, info = env.reset(seed=3)
    assert picture.shape == (40, 48) and picture.dtype == np.uint8
    assert env.observation_space.contains(picture)
    assert 0 <= info["contact"] <= 1 and info["planes"]["labels"].shape == (40, 48)
    for n in range(5):
        action = env.action_space.sample()
        assert env.action_space.contains(action)
        picture, reward, terminated, truncated, info = env.step(action)
        assert isinstance(reward, float) and isinstance(terminated, bool)
        if terminated:
            break
        assert truncated == (n == 4)
    with pytest.raises(RuntimeError, match="reset"):
        env.step(action)


def test_the_same_seed_and_actions_give_the_same_episode(case):
    def run(threads, seed):
        env = VectorEnvironment(case, "keep-needle", 5, size=(40, 40), threads=threads)
        trace = [env.reset(seed=seed)[0]]
        actions = np.random.default_rng(1).uniform(-1, 1, (8, 5, 6))
        for action in actions:
            picture, reward, *_ = env.step(action)
            trace += [picture, reward]
        return trace
    first = run(1, 4)
    for a, b in zip(first, run(3, 4)):
        np.testing.assert_array_equal(a, b)
    assert any((a != b).any() for a, b in zip(first, run(1, 5)))


def test_reset_without_a_seed_begins_elsewhere_each_time(case):
    env = Environment(case, "find-view", size=(32, 32), seed=3)
    begun = [env.reset()[0].tobytes() for _ in range(5)]
    assert len(set(begun)) == 5
    assert env.reset(seed=7)[0].tobytes() == env.reset(seed=7)[0].tobytes()
    assert env.reset(seed=3)[0].tobytes() == begun[0]
    assert env.reset()[0].tobytes() == begun[1]


def test_several_cases_take_turns(case, small):
    other = sonocase.Case.open(small[0])
    env = VectorEnvironment([case, other], "find-view", 3, size=(40, 40))
    pictures, info = env.reset(seed=2)
    assert pictures.shape == (3, 40, 40) and len(info["facts"]) == 3
    pictures, reward, terminated, truncated, info = env.step(np.zeros((3, 6)))
    assert reward.shape == terminated.shape == truncated.shape == (3,)


def test_an_ended_episode_begins_anew_in_the_next_step(case):
    env = VectorEnvironment(case, "find-view", 2, size=(32, 32), longest=2)
    env.reset(seed=0)
    still = np.zeros((2, 6))
    ends = []
    for _ in range(6):
        _, reward, terminated, truncated, _ = env.step(still)
        ends.append(truncated | terminated)
    assert ends[1].all() and not ends[2].any() and not ends[0].all()


def test_a_rule_finds_the_target_and_reaches_it(case):
    """Turn the needle towards the target by what `facts` say, and advance."""
    env = Environment(case, "reach-target", size=(32, 32), longest=120)
    for seed in range(3):
        _, info = env.reset(seed=seed)
        terminated = truncated = False
        while not (terminated or truncated):
            episode = env._all._episodes[0]
            aim = np.linalg.inv(episode.needle) @ np.append(info["facts"]["targets"][0]["centre_mm"], 1)
            action = np.zeros(10)
            action[6] = 1.0 if aim[2] > 0 else -1.0
            action[7] = np.arctan2(aim[0], abs(aim[2]) + 1) / 0.05
            action[8] = -np.arctan2(aim[1], abs(aim[2]) + 1) / 0.05
            _, reward, terminated, truncated, info = env.step(np.clip(action, -1, 1))
        assert terminated and reward > 5


def test_bad_use(case):
    with pytest.raises(ValueError, match="no task fly"):
        Environment(case, "fly")
    env = VectorEnvironment(case, "find-view", 2, size=(32, 32))
    env.reset()
    with pytest.raises(ValueError, match=r"\(2, 6\)"):
        env.step(np.zeros(6))
    with pytest.raises(ValueError, match="not a number"):
        env.step(np.full((2, 6), np.nan))


def test_importing_the_package_imports_no_environment():
    program = "import sys, sonocase; sys.exit('sonocase.environment' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0
