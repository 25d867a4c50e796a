"""Who may import whom: gavel_env <- gavel_agents <- eval, and agents see observations only."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
HIDDEN_WORLD = {"sim", "envs", "instructions.sources"}
HEAVY = {"torch", "transformers", "sentence_transformers", "openai", "anthropic", "xllamacpp", "pandas", "matplotlib"}
# Converters give observations in the form of a library, which they load when they are called.
CONVERTERS = {"gavel_env/envs/pyg.py": {"torch"}}
# The oracle is the declared exception; `verify` checks a plan against a whole scene, and drives nothing.
EXCEPTIONS = {"gavel_agents/oracle.py": {"sim"}}


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def imports(path: Path) -> Iterator[str]:
    """Yield every imported module, also those imported inside functions."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("path", modules("gavel_env"), ids=lambda p: str(p.relative_to(ROOT)))
def test_the_environments_know_no_agent_and_no_model(path: Path) -> None:
    roots = {name.split(".")[0] for name in imports(path)}
    barred = {"gavel_agents", "eval"} | HEAVY - CONVERTERS.get(str(path.relative_to(ROOT)), set())
    assert not roots & barred


@pytest.mark.parametrize("path", modules("gavel_agents"), ids=lambda p: str(p.relative_to(ROOT)))
def test_agents_reach_no_hidden_world(path: Path) -> None:
    allowed = EXCEPTIONS.get(str(path.relative_to(ROOT)), set())
    names = {name.removeprefix("gavel_env.") for name in imports(path) if name.startswith("gavel_env.")}
    barred = tuple(HIDDEN_WORLD - allowed)
    assert not {name for name in names if any(f"{name}.".startswith(f"{hidden}.") for hidden in barred)}
    assert "eval" not in {name.split(".")[0] for name in imports(path)}


def test_only_the_verifier_the_simulated_planner_and_training_read_whole_scenes() -> None:
    readers = {
        str(path.relative_to(ROOT))
        for path in modules("gavel_agents")
        if {"gavel_env.house.scenes.load_scene", "gavel_env.instructions.initial_graph"} & set(imports(path))
    }
    training = "gavel_agents/understanding/learned/targets.py"  # which instances are meant, for the weights alone
    assert readers == {"gavel_agents/verification.py", "gavel_agents/llm/simulated.py", training}
