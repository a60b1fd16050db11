"""Environments of Gymnasium; needs the extra `insonify[gym]`.

Importing this module registers them:

>>> import gymnasium, insonify.gym
>>> environment = gymnasium.make("insonify/Reach-v0")
>>> observation, info = environment.reset(seed=1)
"""

import gymnasium

from ._base import ProbeEnv, RewardWeights
from ._needle import NeedleEnv
from ._reach import ReachEnv, reach_scene
from ._standard_plane import StandardPlaneEnv

__all__ = ["NeedleEnv", "ProbeEnv", "ReachEnv", "RewardWeights", "StandardPlaneEnv", "reach_scene"]

gymnasium.register("insonify/StandardPlane-v0", "insonify.gym:StandardPlaneEnv", max_episode_steps=300)
gymnasium.register("insonify/Reach-v0", "insonify.gym:ReachEnv", max_episode_steps=100)
gymnasium.register("insonify/Needle-v0", "insonify.gym:NeedleEnv", max_episode_steps=300)
