"""Environments: Gymnasium's and Stable-Baselines3's own checks, repeatable episodes, vectors, and a short training."""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import insonify
import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from insonify.gym import ProbeEnv, RewardWeights  # noqa: E402

IDS = ["insonify/Reach-v0", "insonify/StandardPlane-v0"]


def episode(environment: Any, seed: int, steps: int = 12) -> list[Any]:
    observation, info = environment.reset(seed=seed)
    seen = [observation.tobytes(), info["pose"].tobytes()]
    random = np.random.default_rng(seed)
    for _ in range(steps):
        action = random.uniform(-1, 1, environment.action_space.shape).astype(np.float32)
        observation, reward, terminated, _, info = environment.step(action)
        seen += [observation.tobytes(), reward, terminated, info["pose"].tobytes()]
    return seen


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("maps", [False, True])
def test_gymnasiums_own_check_passes(name: str, maps: bool) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # It advises against render modes that it cannot see.
        check_env(gymnasium.make(name, maps=maps, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("name", IDS)
def test_the_check_of_stable_baselines3_passes(name: str) -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(gymnasium.make(name).unwrapped, warn=True)


@pytest.mark.parametrize("name", IDS)
def test_an_episode_of_a_seed_is_the_same_bit_for_bit(name: str) -> None:
    first, second = gymnasium.make(name), gymnasium.make(name)
    assert episode(first, 5) == episode(second, 5) == episode(first, 5)
    assert episode(first, 6) != episode(first, 5)


@pytest.mark.parametrize("kind", ["sync", "async"])
def test_vectors_of_eight_are_the_single_ones(kind: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        vector = gymnasium.make_vec("insonify/Reach-v0", num_envs=8, vectorization_mode=kind)
        try:
            observations, _ = vector.reset(seed=[100 + n for n in range(8)])
            random = np.random.default_rng(1)
            actions = random.uniform(-1, 1, (8, 2)).astype(np.float32)
            moved, rewards, *_ = vector.step(actions)
        finally:
            vector.close()
    for n in range(8):
        single = gymnasium.make("insonify/Reach-v0")
        assert np.array_equal(single.reset(seed=100 + n)[0], observations[n])
        observation, reward, *_ = single.step(actions[n])
        assert np.array_equal(observation, moved[n]) and reward == rewards[n]


def test_reaching_the_mark_ends_an_episode_with_a_reward() -> None:
    environment = gymnasium.make("insonify/Reach-v0")
    _, info = environment.reset(seed=3)
    total, first_mm = 0.0, info["distance_mm"]
    for _ in range(100):
        x, y = -info["pose"][:2] / 4.0
        _, reward, terminated, truncated, info = environment.step(np.clip([x, y], -1, 1).astype(np.float32))
        total += float(reward)
        if terminated:
            break
    assert terminated and not truncated and info["distance_mm"] <= 2
    assert abs(info["path_mm"] - first_mm) < 12
    assert total > 10, total


@pytest.mark.parametrize("action", ["twist", "pose"])
def test_a_hand_that_goes_straight_finds_the_plane_and_holds_it(action: str) -> None:
    environment = gymnasium.make("insonify/StandardPlane-v0", plane="head", action=action)
    inner = environment.unwrapped
    assert isinstance(inner, ProbeEnv)
    home = insonify.Station.obstetric().planes["head"].pose
    _, info = environment.reset(seed=11)
    assert info["cost"] > 1 and info["on_skin"]
    start, rewards = inner.pose, []
    for _ in itertools.count():
        origin = start if action == "pose" else inner.pose
        way = origin.inverse() @ home
        w, *axis = way.quaternion_wxyz
        turn = 2 * np.array(axis) * (1 if w >= 0 else -1)
        if action == "pose":
            wanted = np.concatenate([np.array(way.position_mm) / 120, turn / np.deg2rad(75)])
        else:
            wanted = np.concatenate([np.array(way.position_mm) / 4, turn / np.deg2rad(4)])
        _, reward, terminated, truncated, info = environment.step(np.clip(wanted, -1, 1).astype(np.float32))
        rewards.append(float(reward))
        if terminated or truncated:
            break
    assert terminated, info
    assert info["held"] == 11 and info["cost"] <= 1
    assert rewards[-1] > 9 and sum(rewards) > 10 and len(rewards) < 100


def test_a_probe_in_the_air_and_beyond_its_reach() -> None:
    environment = gymnasium.make("insonify/StandardPlane-v0", on_skin=False, weights=RewardWeights(off_skin=1.0))
    environment.reset(seed=2)
    up = np.array([0, 0, -1, 0, 0, 0], dtype=np.float32)
    for _ in range(12):
        _, reward, _, _, info = environment.step(up)
    assert not info["on_skin"] and float(reward) < -0.5
    kept = info["pose"]
    for _ in range(60):
        *_, info = environment.step(up)
    assert np.linalg.norm(info["pose"][:3] - kept[:3]) < 130


def test_wrong_environments_are_refused() -> None:
    for keywords, words in (
        ({"plane": "foot"}, "no plane `foot`"),
        ({"action": "shove"}, "action is 'shove'"),
        ({"steps_per_s": 0}, "steps_per_s"),
        ({"render_mode": "human"}, "render_mode"),
    ):
        with pytest.raises(insonify.InputError, match=words):
            insonify.gym.StandardPlaneEnv(**keywords)  # type: ignore[arg-type]
    environment = insonify.gym.ReachEnv()
    environment.reset(seed=1)
    with pytest.raises(insonify.InputError, match="finite numbers"):
        environment.step(np.array([np.nan, 0], dtype=np.float32))
    with pytest.raises(insonify.InputError, match="finite numbers"):
        environment.step(np.zeros(3, dtype=np.float32))


def test_memory_is_flat_over_many_steps() -> None:
    from test_render_many import resident_bytes

    environment = gymnasium.make("insonify/Reach-v0")
    environment.reset(seed=1)
    random = np.random.default_rng(1)

    def run(steps: int) -> int:
        for _ in range(steps):
            _, _, terminated, truncated, _ = environment.step(random.uniform(-1, 1, 2).astype(np.float32))
            if terminated or truncated:
                environment.reset()
        return resident_bytes()

    warm = run(300)
    assert run(1500) < 1.02 * warm + 2_000_000
