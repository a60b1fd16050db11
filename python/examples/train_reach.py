"""Trains an agent to bring a cyst to the middle of the picture, and compares it with a random one.

python train_reach.py [MINUTES]: needs insonify[gym] and stable-baselines3.
"""

import sys
import time
from typing import Any

import gymnasium
import insonify.gym
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env

EPISODES = 30

gymnasium.register_envs(insonify.gym)


class Clock(BaseCallback):
    """Ends the training after some minutes."""

    def __init__(self, minutes: float) -> None:
        """Time of the training."""
        super().__init__()
        self._end = time.monotonic() + 60 * minutes

    def _on_step(self) -> bool:
        return time.monotonic() < self._end


def judged(agent: PPO | None, episodes: int) -> tuple[float, float]:
    """Share of episodes that reach the mark, and their mean return; without an agent, of random actions."""
    environment: gymnasium.Env[Any, Any] = gymnasium.make("insonify/Reach-v0")
    random = np.random.default_rng(0)
    reached, returns = 0, 0.0
    for episode in range(episodes):
        observation, _ = environment.reset(seed=1000 + episode)
        over = False
        while not over:
            if agent is None:
                action = random.uniform(-1, 1, 2).astype(np.float32)
            else:
                action, _ = agent.predict(observation, deterministic=True)
            observation, reward, terminated, truncated, _ = environment.step(action)
            returns += float(reward)
            reached += int(terminated)
            over = terminated or truncated
    return reached / episodes, returns / episodes


def train(minutes: float, steps: int = 10_000_000) -> PPO:
    """An agent that has learnt for so many minutes, or so many steps."""
    vector = make_vec_env("insonify/Reach-v0", n_envs=8, seed=1)
    agent = PPO("CnnPolicy", vector, n_steps=64, batch_size=128, n_epochs=4, gamma=0.95, ent_coef=0.002, seed=1)
    agent.learn(steps, callback=Clock(minutes))
    print(f"{agent.num_timesteps} steps")
    return agent


def main(minutes: float) -> None:
    """Trains and compares."""
    agent = train(minutes)
    for name, player in (("random", None), ("trained", agent)):
        share, mean = judged(player, EPISODES)
        print(f"{name}: reaches the mark in {share:.0%} of {EPISODES} episodes, mean return {mean:.2f}")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 10.0)
