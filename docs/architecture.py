"""Draws docs/images/architecture.svg, the pipeline and the packages that hold its parts.

python docs/architecture.py
"""

from __future__ import annotations

from html import escape
from pathlib import Path

PICTURE = Path(__file__).parent / "images" / "architecture.svg"
WIDTH, HEIGHT = 760, 640
INK, SOFT = "#2b2320", "#6b5d55"
AGENTS, WORLD, EVAL = "#e9dfd6", "#d7e5dc", "#dde1ee"


def picture() -> str:
    """Return the picture as SVG."""
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        'font-family="system-ui, sans-serif" role="img" aria-label="The pipeline of GAVEL and its packages">',
        f'<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path d="M0 0 8 4 0 8z" fill="{SOFT}"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="10" fill="#fdfbf9"/>',
        _text(380, 36, "“Bring the milk to the coffee table and wash the mug.”", size=17, italic=True),
        _arrow((135, 48), (135, 66)),
        _box(20, 70, 230, 104, AGENTS, "Understand", ("tasks, objects, stated", "relations, goals g"), "understanding"),
        _box(
            265,
            70,
            230,
            104,
            AGENTS,
            "Believe",
            ("graph G₀, and where unseen", "things may be: b(r)"),
            "beliefs, rsn",
        ),
        _box(
            510,
            70,
            230,
            104,
            AGENTS,
            "Propose",
            ("a model (or a planner)", "writes a plan per task"),
            "proposing, llm",
        ),
        _arrow((250, 122), (263, 122)),
        _arrow((495, 122), (508, 122)),
        _box(
            510,
            224,
            230,
            104,
            WORLD,
            "Validate",
            ("roll the plan out: f(G, a),", "unmet goals, safe(π)"),
            "world_model",
            "gavel_env",
        ),
        _box(265, 224, 230, 104, AGENTS, "Repair", ("edit what follows from the", "model and the goal"), "edits"),
        _arrow((600, 174), (600, 222)),
        _arrow((510, 258), (497, 258)),
        _arrow((495, 294), (508, 294)),
        _arrow((660, 224), (660, 176)),
        _text(670, 204, "what is left, told in words", size=12, anchor="start", colour=SOFT, split=True),
        _box(20, 378, 230, 104, AGENTS, "Order", ("expected search metres J;", "cheapest task first"), "ordering"),
        _box(265, 378, 230, 104, AGENTS, "Execute", ("bind names to instances,", "one task"), "pipeline, binding"),
        _box(510, 378, 230, 104, AGENTS, "Update", ("seen: localised; searched", "in vain: room ruled out"), "beliefs"),
        f'<path d="M625 328 V352 H135 V376" fill="none" stroke="{SOFT}" stroke-width="1.6" marker-end="url(#tip)"/>',
        _text(380, 346, "valid plans", size=13, colour=SOFT),
        _arrow((250, 430), (263, 430)),
        _arrow((495, 430), (508, 430)),
        f'<path d="M625 482 V498 H135 V484" fill="none" stroke="{SOFT}" stroke-width="1.6" marker-end="url(#tip)"/>',
        _text(190, 514, "after every task", size=13, colour=SOFT),
        _arrow((350, 482), (350, 526)),
        _arrow((420, 526), (420, 484)),
        _text(342, 520, "actions", size=13, anchor="end", colour=SOFT),
        _text(428, 520, "observations", size=13, anchor="start", colour=SOFT),
        _band(
            530,
            WORLD,
            "gavel_env",
            "the hidden house G*: rooms, furniture, robot, camera, search (house, sim, envs)",
        ),
        _band(584, EVAL, "eval", "steps agents through environments; records → tables, figures, report"),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _text(
    x: float,
    y: float,
    text: str,
    *,
    size: int = 14,
    anchor: str = "middle",
    colour: str = INK,
    bold: bool = False,
    italic: bool = False,
    mono: bool = False,
    split: bool = False,
) -> str:
    style = ' font-weight="600"' * bold + ' font-style="italic"' * italic + ' font-family="monospace"' * mono
    lines = [text]
    if split:  # after half of the words
        words = text.split()
        lines = [" ".join(words[: len(words) // 2]), " ".join(words[len(words) // 2 :])]
    return "\n".join(
        f'<text x="{x}" y="{y + 15 * index - 7.5 * (len(lines) - 1)}" font-size="{size}" text-anchor="{anchor}" '
        f'fill="{colour}"{style}>{escape(line)}</text>'
        for index, line in enumerate(lines)
    )


def _box(
    x: float,
    y: float,
    width: float,
    height: float,
    colour: str,
    title: str,
    lines: tuple[str, ...],
    home: str,
    package: str = "gavel_agents",
) -> str:
    middle = x + width / 2
    return "\n".join(
        [
            f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="8" fill="{colour}" stroke="#b9aca2"/>',
            _text(middle, y + 25, title, size=17, bold=True),
            *(_text(middle, y + 48 + 18 * index, line, size=15) for index, line in enumerate(lines)),
            _text(middle, y + height - 9, f"{package}/ {home}", size=11, mono=True, colour=SOFT),
        ]
    )


def _band(y: float, colour: str, title: str, line: str) -> str:
    return "\n".join(
        [
            f'<rect x="20" y="{y}" width="720" height="42" rx="8" fill="{colour}" stroke="#b9aca2"/>',
            _text(36, y + 27, title, size=15, bold=True, anchor="start"),
            _text(128, y + 27, line, size=14, anchor="start"),
        ]
    )


def _arrow(start: tuple[float, float], end: tuple[float, float]) -> str:
    return (
        f'<path d="M{start[0]} {start[1]} L{end[0]} {end[1]}" stroke="{SOFT}" stroke-width="1.6" '
        'marker-end="url(#tip)"/>'
    )


if __name__ == "__main__":
    PICTURE.write_text(picture(), "utf-8")
