"""The same seed gives the same trajectory: again, in another process, under another hash seed. And a light import."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.houses import FILE, INSTRUCTIONS, make, send, unwrapped

HERE = Path(__file__).parent


def trajectory(seed: int) -> str:
    """Return a hash of everything that is observed in random play and along the reference plans."""
    digest = hashlib.sha256()
    env = make(on_violation="noop")
    env.action_space.seed(seed)
    for episode in range(4):
        observation, info = env.reset(seed=seed if episode == 0 else None)
        for _ in range(25):
            note(digest, observation, info)
            observation, reward, terminated, _, info = env.step(env.action_space.sample())
            digest.update(repr(reward).encode())
            if terminated:
                break
    for name, instruction in INSTRUCTIONS.items():
        observation, info = env.reset(seed=seed, options={"instruction": name})
        for action in instruction.reference_plan():
            note(digest, observation, info)
            observation, _, terminated, _, info = env.step(send(env, action))
            if terminated:
                break
        note(digest, observation, info)
    return digest.hexdigest()


def note(digest: hashlib._Hash, observation: dict[str, object], info: dict[str, object]) -> None:
    for name in sorted(observation):
        value = observation[name]
        if name == "graph":
            for part in value:  # type: ignore[attr-defined]
                digest.update(np.ascontiguousarray(part).tobytes())
        else:
            digest.update(repr(value).encode())
    shown = {k: v for k, v in info.items() if k != "observed"}
    observed = info["observed"]
    digest.update(repr(shown).encode())
    digest.update(repr((list(observed.positions.items()), sorted(observed.searched))).encode())  # type: ignore[attr-defined]


def in_another_process(code: str, hash_seed: str) -> str:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=HERE,
        env={**os.environ, "PYTHONHASHSEED": hash_seed, "PYTHONPATH": os.pathsep.join(("../..", "..", *sys.path[1:]))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_same_seed_same_trajectory_in_one_process() -> None:
    assert trajectory(3) == trajectory(3)
    assert trajectory(3) != trajectory(4)


@pytest.mark.parametrize("hash_seed", ["1", "4242"])
def test_same_seed_same_trajectory_in_other_processes(hash_seed: str) -> None:
    assert in_another_process("import test_determinism as t; print(t.trajectory(3))", hash_seed) == trajectory(3)


def test_seed_draws_the_instruction() -> None:
    drawn = [make().reset(seed=seed)[1]["instruction_id"] for seed in range(12)]
    assert drawn == [make().reset(seed=seed)[1]["instruction_id"] for seed in range(12)]
    assert len(set(drawn)) > 2


def test_seed_places_what_lies_on_the_floor() -> None:
    spots = set()
    for seed in range(6):
        env = make()
        env.reset(seed=seed, options={"instruction": "rs_steak_on_floor"})
        spots.add(unwrapped(env).privileged_state().executor.position("steak_0"))
    assert len(spots) > 3


HEAVY = ("numba", "cv2", "pandas", "torch", "matplotlib", "networkx", "transformers", "scipy")


def test_import_is_light_and_registers_the_environments() -> None:
    code = (
        "import sys; import gavel_env\n"
        "ours = sorted(m for m in sys.modules if m.partition('.')[0] in ('gavel_env', 'gavel_agents', 'eval'))\n"
        "import gymnasium\n"
        f"print([m for m in {HEAVY} if m in sys.modules], ours,"
        " sorted(i for i in gymnasium.registry if i.startswith('Gavel-')), sep='|')"
    )
    heavy, ours, ids = in_another_process(code, "0").split("|")
    assert heavy == "[]"
    assert ours == "['gavel_env']"
    assert "'Gavel-MultiTask-v0'" in ids
    assert "'Gavel-SingleTask-v0'" in ids


def test_every_public_name_is_there() -> None:
    import gavel_env

    for name in gavel_env.__all__:
        assert getattr(gavel_env, name) is not None
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = gavel_env.no_such_name
    assert FILE.is_file()
