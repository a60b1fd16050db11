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
from insonify.gym import NeedleEnv, ProbeEnv, RewardWeights  # noqa: E402

IDS = ["insonify/Reach-v0", "insonify/StandardPlane-v0", "insonify/Needle-v0"]


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


def toward(here: insonify.Pose, there: insonify.Pose) -> Any:
    """Action that moves a tool to a pose."""
    way = here.inverse() @ there
    w, *axis = way.quaternion_wxyz
    turn = 2 * np.array(axis) * (1 if w >= 0 else -1)
    wanted = np.concatenate([np.array(way.position_mm) / 2, turn / np.deg2rad(3)])
    # The whole way is scaled, so that the tip goes straight.
    return (wanted / max(1.0, float(np.abs(wanted).max()))).astype(np.float32)


def punctured(environment: Any, seed: int, aside_mm: float = 0.0) -> tuple[float, int, bool, dict[str, Any]]:
    """An episode of a hand that lines both tools up with the plan and advances the needle; `aside_mm` off the image
    plane. Gives the return, the steps, whether the episode ended by itself, and its last `info`."""
    inner = environment.unwrapped
    assert isinstance(inner, NeedleEnv) and inner.station.exercise is not None
    plan = inner.station.exercise.plan
    length_mm = float(np.linalg.norm(np.array(plan.aim_mm) - plan.entry_mm))
    across = plan.probe @ insonify.Pose((0, aside_mm, 0)) @ plan.probe.inverse()
    line = across @ plan.needle
    _, info = environment.reset(seed=seed)
    total, lined_up = 0.0, False
    for step in itertools.count(1):
        depth_mm = -5.0 if not lined_up else length_mm
        action = toward(inner.needle, line @ insonify.Pose((0, 0, depth_mm)))
        lined_up = lined_up or bool(np.abs(action).max() < 0.05)
        held = toward(inner.pose, plan.probe)[: environment.action_space.shape[0] - 6]
        _, reward, terminated, truncated, info = environment.step(np.concatenate([action, held]))
        total += float(reward)
        if terminated or truncated:
            return total, step, terminated, info
    raise AssertionError


@pytest.mark.parametrize("name", ["needle_cyst", "needle_vessel"])
@pytest.mark.parametrize("move_probe", [False, True])
def test_a_hand_that_goes_straight_reaches_the_target_in_sight(name: str, move_probe: bool) -> None:
    environment = gymnasium.make("insonify/Needle-v0", station=name, move_probe=move_probe)
    for seed in range(3):
        total, steps, terminated, info = punctured(environment, seed)
        assert terminated and info["reached"] and info["distance_mm"] == 0 and info["forbidden"] == 0, info
        assert info["visible"] and steps < 60 and info["path_mm"] < 80
        # 10 at the end, 5 in the target, and a unit for each 10 mm.
        assert total > 16, (total, info)
        score = environment.unwrapped.score()
        assert score.reached is not None and score.points is not None and score.points > 60, str(score)


def test_random_actions_do_not_reach_the_target() -> None:
    environment = gymnasium.make("insonify/Needle-v0")
    random, returns, reached = np.random.default_rng(0), [], 0
    for seed in range(4):
        environment.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            _, reward, terminated, truncated, info = environment.step(random.uniform(-1, 1, 6).astype(np.float32))
            total += float(reward)
            over = terminated or truncated
        returns.append(total)
        reached += int(info["reached"])
    assert reached == 0 and max(returns) < 5, returns


def test_a_tip_out_of_sight_earns_less_and_a_forbidden_puncture_costs() -> None:
    seen = punctured(gymnasium.make("insonify/Needle-v0"), 1)
    hidden = punctured(gymnasium.make("insonify/Needle-v0"), 1, aside_mm=5.0)
    assert seen[2] and not hidden[2], "an episode goes on while the tip is hidden"
    assert hidden[3]["reached"] and not hidden[3]["visible"] and hidden[3]["offset_mm"] > 4
    assert 9 < seen[0] - hidden[0] < 11 and hidden[0] > 5, (seen, hidden)
    station = insonify.Station("needle_cyst", exercise={"target": "artery", "forbidden": ["cyst"]})
    station.set(exercise={"target": None, "target_mm": [0, 0, 30], "radius_mm": 1.0})
    total, _, terminated, info = punctured(gymnasium.make("insonify/Needle-v0", station=station), 1)
    assert terminated and not info["reached"] and info["forbidden"] == 1
    assert total < -5, "10 for the puncture, less the way to it"
    light = RewardWeights(forbidden=0.0)
    assert punctured(gymnasium.make("insonify/Needle-v0", station=station, weights=light), 1)[0] == pytest.approx(
        total + 10
    )


def test_the_needle_is_in_the_observation_and_within_its_reach() -> None:
    environment = gymnasium.make("insonify/Needle-v0", maps=True, reach_mm=45.0, render_mode="rgb_array")
    inner = environment.unwrapped
    assert isinstance(inner, NeedleEnv)
    number = inner.station.tissue_names.index("needle")
    punctured(environment, 2)
    observation, *_ = environment.step(np.zeros(6, np.float32))
    assert observation.shape == (84, 84, 3) and (observation[:, :, 1] == number).any()
    assert np.array_equal(environment.render()[:, :, 0], observation[:, :, 0])
    _, info = environment.reset(seed=2)
    for _ in range(60):
        *_, info = environment.step(np.array([0, 0, -1, 0, 0, 0], dtype=np.float32))
    plan = inner.station.exercise.plan if inner.station.exercise else None
    assert plan is not None and 40 < np.linalg.norm(info["needle"][:3] - plan.entry_mm) <= 45


def test_a_probe_that_moves_stays_on_the_skin() -> None:
    environment = gymnasium.make("insonify/Needle-v0", move_probe=True)
    assert environment.action_space.shape == (12,)
    _, info = environment.reset(seed=4)
    first = info["pose"]
    for _ in range(10):
        action = np.zeros(12, np.float32)
        action[6:9] = (1, 0, -1)
        *_, info = environment.step(action)
        assert info["on_skin"]
    assert 15 < np.linalg.norm(info["pose"][:3] - first[:3]) < 25


def test_wrong_needle_environments_are_refused() -> None:
    cyst = insonify.Station("needle_cyst")
    for keywords, words in (
        ({"station": "sphere"}, "the station has no needle"),
        ({"station": cyst.copy(exercise=None)}, "the station has no exercise"),
        ({"station": cyst.copy(needle={"kind": "pointer"})}, "a pointer, which pictures do not show"),
        ({"station": cyst.copy(pose=None)}, "no pose of its own"),
        ({"steps_per_s": 3.0}, "steps_per_s is 3.0"),
        ({"render_mode": "human"}, "render_mode"),
    ):
        with pytest.raises(insonify.InputError, match=words):
            NeedleEnv(**keywords)  # type: ignore[arg-type]
    with pytest.raises(insonify.StationError, match="did you mean `cyst`"):
        NeedleEnv(station=cyst.copy(exercise={"target": "cist"}))
    environment = NeedleEnv()
    environment.reset(seed=1)
    for action in (np.zeros(12, np.float32), np.full(6, np.nan, np.float32)):
        with pytest.raises(insonify.InputError, match="finite numbers"):
            environment.step(action)


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
