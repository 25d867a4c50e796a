"""Learning libraries take Gavel-RL-v0 as it is; MaskablePPO solves its easy level."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.spaces import Discrete

import gavel_env  # noqa: F401  # registers the environments

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::UserWarning"),
]


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    torch = pytest.importorskip("torch", reason="needs the extra [rl]")
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def test_maskable_ppo_solves_the_easy_level_within_50k_steps() -> None:
    pytest.importorskip("sb3_contrib", reason="needs the extra [rl]")
    from eval.studies.learning import masked_random, solved_share, train

    random = solved_share(masked_random())
    learned = train("easy", 50_000, seed=0)
    assert random < 0.2
    assert solved_share(learned.policy) >= 0.9
    assert learned.curve[-1][1] >= 0.9
    assert learned.curve[0][1] < 0.5


def test_plain_ppo_takes_it_as_it_is() -> None:
    stable_baselines3 = pytest.importorskip("stable_baselines3", reason="needs the extra [rl]")
    from stable_baselines3.common.env_checker import check_env
    from stable_baselines3.common.vec_env import SubprocVecEnv

    check_env(gym.make("Gavel-RL-v0"))
    model = stable_baselines3.PPO("MlpPolicy", "Gavel-RL-v0", n_steps=64, batch_size=64, device="cpu").learn(128)
    observation, _ = gym.make("Gavel-RL-v0").reset(seed=0)
    assert 0 <= int(model.predict(observation)[0]) < 72
    envs = SubprocVecEnv([lambda: gym.make("gavel_env:Gavel-RL-v0")] * 2)
    try:
        assert envs.reset().shape == (2, *envs.observation_space.shape)
        assert len(envs.env_method("action_masks")) == 2
    finally:
        envs.close()


def width(space: gym.Space[Any]) -> int:
    assert space.shape is not None
    return space.shape[0]


def test_torchrl_rolls_it_out_with_masks() -> None:
    torchrl_envs = pytest.importorskip("torchrl.envs", reason="torchrl is not installed")
    from torchrl.envs.libs.gym import default_info_dict_reader

    env = torchrl_envs.GymEnv("Gavel-RL-v0", device="cpu")
    env.set_info_dict_reader(default_info_dict_reader(["action_mask"]))
    masked = torchrl_envs.TransformedEnv(env, torchrl_envs.ActionMask(mask_key="action_mask"))
    masked.set_seed(0)
    rollout = masked.rollout(50, break_when_any_done=False)
    assert rollout["observation"].shape == (50, width(gym.make("Gavel-RL-v0").observation_space))
    taken = rollout["action"]
    index = taken.argmax(-1) if taken.ndim > 1 else taken
    assert rollout["action_mask"].bool().gather(-1, index.unsqueeze(-1)).all()


def test_a_loop_as_cleanrl_writes_it_learns_from_it() -> None:
    """Masked REINFORCE in a page of torch: the return of the last tenth beats that of the first."""
    torch = pytest.importorskip("torch")
    torch.manual_seed(0)
    envs = gym.make_vec("Gavel-RL-v0", num_envs=4, vectorization_mode="sync", level="easy")
    assert isinstance(envs.single_action_space, Discrete)
    length, actions = width(envs.single_observation_space), int(envs.single_action_space.n)
    network = torch.nn.Sequential(torch.nn.Linear(length, 64), torch.nn.Tanh(), torch.nn.Linear(64, actions + 1))
    optimiser = torch.optim.Adam(network.parameters(), lr=3e-3)
    observation, info = envs.reset(seed=0)
    means = []
    for _ in range(100):
        logs, rewards, values, dones, entropies = [], [], [], [], []
        for _ in range(32):
            out = network(torch.as_tensor(observation))
            mask = torch.as_tensor(np.stack(info["action_mask"])).bool()
            choice = torch.distributions.Categorical(logits=out[:, :actions].masked_fill(~mask, -1e9))
            action = choice.sample()
            observation, reward, terminated, truncated, info = envs.step(action.numpy())
            logs.append(choice.log_prob(action))
            entropies.append(choice.entropy())
            values.append(out[:, -1])
            rewards.append(torch.as_tensor(reward, dtype=torch.float32))
            dones.append(torch.as_tensor(terminated | truncated, dtype=torch.float32))
        with torch.no_grad():
            running = network(torch.as_tensor(observation))[:, -1]
            returns: list[Any] = []
            for reward, done in zip(reversed(rewards), reversed(dones), strict=True):
                running = reward + 0.99 * running * (1 - done)
                returns.insert(0, running)
        target, value = torch.stack(returns), torch.stack(values)
        advantage = (target - value).detach()
        advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-6)
        loss = -(torch.stack(logs) * advantage).mean() + 0.5 * ((target - value) ** 2).mean()
        loss = loss - 0.01 * torch.stack(entropies).mean()
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 0.5)
        optimiser.step()
        means.append(float(torch.stack(rewards).mean()))
    envs.close()
    assert np.mean(means[-10:]) > np.mean(means[:10]) + 0.05
