# SPDX-License-Identifier: Apache-2.0
"""Environments: the interface, determinism, and tasks that a simple rule can solve."""

import copy
import pickle
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


def test_environments_without_a_seed_differ_and_the_constructors_is_that_of_reset(case):
    for task in TASKS:
        begun = {Environment(case, task, size=(32, 32)).reset()[0].tobytes() for _ in range(5)}
        begun |= {p.tobytes() for p in VectorEnvironment(case, task, 3, size=(32, 32)).reset()[0]}
        assert len(begun) == 8

        def episode(env, **seed):
            trace = [env.reset(**seed)]
            trace += [env.step(np.full(env.action_space.shape, 0.3)) for _ in range(3)]
            return [step[0].tobytes() for step in trace]
        expected = episode(Environment(case, task, size=(32, 32), seed=5))
        assert expected == episode(Environment(case, task, size=(32, 32)), seed=5)
        assert expected == episode(Environment(case, task, size=(32, 32), seed=6), seed=5)
        assert expected != episode(Environment(case, task, size=(32, 32), seed=6))
    for bad in (-1, 1.5, "x"):
        with pytest.raises(ValueError, match="seed: .* is no seed"):
            Environment(case, seed=bad)


@pytest.mark.parametrize("task", TASKS)
def test_a_copy_goes_on_as_the_original_does(case, task):
    for make in (lambda: Environment(case, task, size=(32, 32), planes=["labels"]),
                 lambda: VectorEnvironment(case, task, 2, size=(32, 32), planes=["labels"])):
        env = make()
        env.reset(seed=1)
        env.step(np.full(env.action_space.shape, 0.5))
        for copied in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
            twin = copy.deepcopy(env)  # the original's state is used up
            for n in range(5):
                action = np.full(env.action_space.shape, 0.2 * n - 0.4)
                a, b = twin.step(action), copied.step(action)
                np.testing.assert_array_equal(a[0], b[0])
                assert np.all(a[1] == b[1]) and np.all(a[2] == b[2])


def test_keep_needle_ends_at_the_targets_depth_or_when_the_needle_is_lost(case):
    for seed in range(3):
        env = Environment(case, "keep-needle", size=(16, 16), longest=400)
        _, info = env.reset(seed=seed)
        lost, terminated, truncated = 0, False, False
        while not (terminated or truncated):
            tip = info["facts"]["tip"]
            across = tip["probe_mm"][1]
            # Of the odd seed the probe is held still, and the needle drifts away.
            action = np.zeros(6) if seed == 1 else np.array([0, np.clip(across / 3, -1, 1), 0, 0, 0, 0])
            _, reward, terminated, truncated, info = env.step(action)
            facts = info["facts"]
            probe_from = np.linalg.inv(facts["mannequin_from_probe"])
            target_mm = (probe_from @ np.append(facts["targets"][0]["centre_mm"], 1))[2]
            lost = 0 if facts["tip"]["in_plane"] else lost + 1
            x, y, z = facts["tip"]["probe_mm"]
            assert terminated == (z >= target_mm or lost >= 40 or abs(y) > 40)
        assert terminated
        assert lost < 40 or seed == 1
    env = Environment(case, "keep-needle", size=(16, 16))
    env.reset(seed=0)
    for n in range(200):
        if env.step([0, 1, 0, 0, 0, 0])[2]:  # away from the needle
            break
    assert 10 < n < 60


def test_infos_are_arrays_with_masks(case):
    env = VectorEnvironment(case, "reach-target", 3, size=(24, 16), planes=["labels", "needle"])
    for info in (env.reset(seed=1)[1], env.step(np.zeros((3, 10)))[4]):
        assert set(info) == {"facts", "_facts", "planes", "_planes", "contact", "_contact"}
        for name in ("facts", "planes", "contact"):
            assert isinstance(info[name], np.ndarray) and info[name].shape == (3,)
            mask = info[f"_{name}"]
            assert mask.dtype == bool and mask.shape == (3,) and mask.all()
        assert info["facts"].dtype == info["planes"].dtype == object and info["contact"].dtype.kind == "f"
        for n in range(3):
            assert info["facts"][n]["targets"][0]["name"] == "vessel"
            assert info["planes"][n]["labels"].shape == (16, 24)
    one = Environment(case, "find-view", size=(16, 16)).reset(seed=1)[1]
    assert set(one) == {"facts", "planes", "contact"} and isinstance(one["facts"], dict)


def test_no_environment_moves_where_one_action_is_refused(case):
    env = VectorEnvironment(case, "reach-target", 3, size=(16, 16))
    env.reset(seed=1)
    twin = copy.deepcopy(env)
    bad = np.ones((3, 10))
    bad[2, 4] = np.nan
    with pytest.raises(ValueError, match="actions: that of environment 2 is not a number"):
        env.step(bad)
    a, b = env.step(np.ones((3, 10))), twin.step(np.ones((3, 10)))
    np.testing.assert_array_equal(a[0], b[0])
    assert [f["time_s"] for f in a[4]["facts"]] == [f["time_s"] for f in b[4]["facts"]]


def test_render_gives_the_picture_in_colour(case):
    env = Environment(case, "find-view", size=(24, 16), render_mode="rgb_array")
    assert env.metadata["render_modes"] == ["rgb_array"] and env.render_mode == "rgb_array"
    with pytest.raises(RuntimeError, match="reset"):
        env.render()
    picture, _ = env.reset(seed=1)
    for _ in range(2):
        shown = env.render()
        assert shown.shape == (16, 24, 3) and shown.dtype == np.uint8
        np.testing.assert_array_equal(shown, np.stack([picture] * 3, 2))
        picture = env.step(env.action_space.sample())[0]
    many = VectorEnvironment(case, "find-view", 2, size=(24, 16), render_mode="rgb_array")
    pictures, _ = many.reset(seed=1)
    assert [p[..., 1].tobytes() for p in many.render()] == [p.tobytes() for p in pictures]
    silent = Environment(case, "find-view", size=(16, 16))
    silent.reset()
    assert silent.render_mode is None and silent.render() is None
    with pytest.raises(ValueError, match="render_mode: no mode human: give None or rgb_array"):
        Environment(case, render_mode="human")


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
    with pytest.raises(ValueError, match="cases: the list is empty: give at least one case"):
        VectorEnvironment([])
    with pytest.raises(ValueError, match="unknown plane 'nope'"):
        Environment(case, planes=["nope"])
    for closed in (env, Environment(case, "find-view", size=(16, 16))):
        closed.close()
        closed.close()
        for use in (closed.reset, lambda: closed.step(np.zeros(closed.action_space.shape)), closed.render):
            with pytest.raises(sonocase.Error, match="environment: it is closed: make another one"):
                use()


def test_importing_the_package_imports_no_environment():
    program = """
import sys, sonocase
for name in ("data", "domain", "environment"):
    assert f"sonocase.{name}" not in sys.modules
    assert name in dir(sonocase)
assert "numpy" not in sys.modules
for name in ("domain", "environment", "data"):
    assert getattr(sonocase, name) is sys.modules[f"sonocase.{name}"]
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
