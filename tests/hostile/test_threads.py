"""Threads that are the first to load anything: everything shared is built by one of them."""

from __future__ import annotations

import subprocess
import sys

import pytest
from support.hostile import times

pytestmark = pytest.mark.hostile

LOADING = """
import sys, threading
sys.setswitchinterval(1e-6)
from gavel_env.house.scenes import load_scene, scene_names
from gavel_env.instructions.record import read_instructions, shipped
names, failed = scene_names(), []
start = threading.Barrier(16)

def load(number):
    start.wait()
    try:
        load_scene(names[3 * number])
        read_instructions(shipped("single"))
    except BaseException as error:
        failed.append(error)

threads = [threading.Thread(target=load, args=(number,)) for number in range(16)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert not failed, failed
"""

PLAYING = """
import sys, threading
sys.setswitchinterval(1e-5)
import gymnasium as gym
import gavel_agents, gavel_env
from gavel_agents.understanding import load_understanding
failed, ended = [], []
start = threading.Barrier(8)

def play(number):
    start.wait()
    try:
        env = gym.make("Gavel-SingleTask-v0")
        agent = gavel_agents.make("gavel-full", understanding="rules", planner="classical", seed=number)
        observation, info = env.reset(seed=number)
        agent.reset(observation, info)
        for _ in range(5):
            action = agent.act(observation, info)
            if action is None:
                break
            observation, _, _, _, info = env.step(action)
        ended.append(number)
    except BaseException as error:
        failed.append(error)

threads = [threading.Thread(target=play, args=(number,)) for number in range(8)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert not failed, failed
assert len(ended) == 8
"""


def fresh(script: str) -> None:
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300, check=False)
    assert ran.returncode == 0, f"exit status {ran.returncode}\n{ran.stderr[-2000:]}"


@pytest.mark.parametrize("number", range(times(4, 100)))
def test_sixteen_threads_of_a_fresh_process_load_sixteen_scenes_at_once(number: int) -> None:
    fresh(LOADING)


@pytest.mark.parametrize("number", range(times(1, 25)))
def test_eight_threads_of_a_fresh_process_make_environments_and_agents_at_once(number: int) -> None:
    fresh(PLAYING)
