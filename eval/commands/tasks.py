"""`gavel tasks`: list, show, validate and generate instructions."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gavel_env.instructions.record import Instruction, InstructionSet

__all__ = ["register"]

SHIPPED = ("single", "multi")


def register(subparsers: Any) -> None:
    """Add `gavel tasks`."""
    family = subparsers.add_parser("tasks", help="instructions: list, show, validate, generate").add_subparsers(
        title="task commands", metavar="COMMAND", required=True
    )
    files = "shipped set (single, multi, behavior) or instruction file; default: single and multi"

    listing = family.add_parser("list", help="one line per instruction, or figures of the set")
    listing.add_argument("sets", nargs="*", metavar="SET", help=files)
    listing.add_argument("--stats", action="store_true", help="print the figures of each set instead of its lines")
    listing.add_argument(
        "--orders", action="store_true", help="count the instructions that map, static and full order differently"
    )
    listing.add_argument("--scene", help="only instructions of this scene")
    listing.set_defaults(run=_list)

    show = family.add_parser("show", help="text, goal, placements and reference plan of an instruction")
    show.add_argument("id", help="id of the instruction")
    show.add_argument("sets", nargs="*", metavar="SET", help=files)
    show.add_argument("--png", type=Path, metavar="FILE", help="draw the house with the reference route")
    show.add_argument("--pixels-per-m", type=float, metavar="N", help="scale of the picture")
    show.set_defaults(run=_show)

    validate = family.add_parser("validate", help="re-check certificates; exit status 1 if one does not hold")
    validate.add_argument("sets", nargs="*", metavar="SET", help=files)
    validate.add_argument("--symbolic", action="store_true", help="do not drive the plans in the executor")
    validate.set_defaults(run=_validate)

    generate = family.add_parser("generate", help="make fresh certified instructions, the same for the same seed")
    generate.add_argument("--kind", choices=("single", "multi"), default="multi")
    generate.add_argument("--n", type=int, default=50, help="how many (default: 50)")
    generate.add_argument("--seed", type=int, default=0)
    generate.add_argument(
        "--houses", nargs="+", default=["benchmark"], metavar="SCENE", help="scenes, or benchmark, held-out, all"
    )
    generate.add_argument(
        "--tasks", type=_span, default=(2, 5), metavar="A-B", help="errands per multi-task instruction (default: 2-5)"
    )
    generate.add_argument(
        "--rooms-spread", type=_span, default=(1, 99), metavar="A-B", help="rooms in which the plan stops"
    )
    generate.add_argument(
        "--horizon", type=_span, default=(1, 99), metavar="A-B", help="length of the plan in primitives"
    )
    generate.add_argument(
        "--surprise", type=float, default=0.1, help="chance that a thing starts in an unlikely place (default: 0.1)"
    )
    generate.add_argument(
        "--say-room", type=float, default=0.46, help="chance that furniture is named with its room (default: 0.46)"
    )
    generate.add_argument("--distractors", type=int, default=2, help="things that the task does not need (default: 2)")
    generate.add_argument("--split", choices=("benchmark", "validation", "train"), default="benchmark")
    generate.add_argument("--any-pairs", action="store_true", help="object pairs of all splits, not only of --split")
    generate.add_argument("--out", type=Path, metavar="FILE", help="instruction file to write (default: stdout)")
    generate.set_defaults(run=_generate)


def _span(text: str) -> tuple[int, int]:
    low, dash, high = text.partition("-")
    try:
        span = int(low), int(high if dash else low)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a range; write 2-5 or 4") from None
    if span[0] > span[1] or span[0] < 0:
        raise argparse.ArgumentTypeError(f"{text!r} is empty; write the smaller number first")
    return span


def _path(name: str) -> Path:
    from gavel_env.instructions.record import shipped

    return Path(name) if name.endswith((".jsonl", ".json")) or "/" in name else shipped(name)


def _read(sets: list[str]) -> list[tuple[Path, InstructionSet]]:
    from gavel_env.instructions.record import read_instructions

    paths = [_path(name) for name in sets or SHIPPED]
    return [(path, read_instructions(path)) for path in paths]


def _list(arguments: argparse.Namespace) -> int:
    for path, records in _read(arguments.sets):
        chosen = [r for r in records.values() if arguments.scene in (None, r.scene)]
        rejected = f", {len(records.rejected)} lines rejected" if records.rejected else ""
        print(f"{path.name}: {len(chosen)} instructions, content {records.stamp}{rejected}")
        if arguments.stats:
            _print_figures(chosen)
        if arguments.orders:
            _print_orders(chosen)
        if arguments.stats or arguments.orders:
            continue
        for record in chosen:
            print(f"{record.id}\t{len(record.tasks)}\t{len(record.reference_plan())}\t{record.text}")
    return 0


def _print_figures(records: list[Instruction]) -> None:
    from gavel_env.tasks.statistics import statistics

    figures = statistics(records)
    counted: dict[str, Mapping[Any, int]] = {
        "scenes": figures.scenes,
        "tasks per instruction": figures.tasks,
        "goal literals": figures.literals,
        "literals per task": figures.literals_per_task,
        "errand shapes": figures.shapes,
    }
    low, high = figures.steps_range
    print(f"  reference plan       mean {figures.steps_mean:.2f} primitives ({low}-{high})")
    print(f"  rooms                mean {figures.rooms_mean:.2f} in which the plan stops")
    print(f"  need an appliance    {figures.appliance} (cooked, washed, dried)")
    if figures.room_unsaid is not None and figures.room_said is not None:
        print(f"  furniture references {100 * figures.room_unsaid:.1f} % leave the room unsaid")
        print(f"  texts                {100 * figures.room_said:.1f} % say the room of some piece of furniture")
        print(f"  clause templates     {figures.templates}")
    for name, counts in counted.items():
        print(f"  {name:<20} " + ", ".join(f"{key} {count}" for key, count in counts.items()))


def _print_orders(records: list[Instruction]) -> None:
    from eval.studies.orders import METHODS, Orders

    orders = Orders()
    differ = sum(orders.differ(record) for record in records if len(record.tasks) > 1)
    several = sum(len(record.tasks) > 1 for record in records)
    print(f"  orders               {differ} of {several} differ between {', '.join(METHODS)}")


def _show(arguments: argparse.Namespace) -> int:
    from gavel_env.errors import UnknownInstruction

    sets = [records for _, records in _read(arguments.sets)]
    record = next((records[arguments.id] for records in sets if arguments.id in records), None)
    if record is None:
        raise UnknownInstruction(arguments.id, [name for records in sets for name in records], "these sets")
    print(f"{record.id} in {record.scene}\n\n{record.text}\n")
    for placement in record.placements:
        states = f" ({', '.join(placement.states)})" if placement.states else ""
        print(f"  {placement.id or placement.category} starts {placement.relation} {placement.target}{states}")
    for state in record.initial:
        print(f"  {state} at the start")
    for task in record.tasks:
        print(f"\n{task.text}\n  goal: {', '.join((*task.goal, *map(str, task.conditions)))}")
        print("\n".join(f"  {step:2d} {action}" for step, action in enumerate(task.reference_plan)))
    if arguments.png is not None:
        _draw(record, arguments.png, arguments.pixels_per_m)
    return 0


def _draw(record: Instruction, path: Path, pixels_per_m: float | None) -> None:
    from gavel_env.house.scenes import load_scene
    from gavel_env.instructions.initial_graph import instruction_graph
    from gavel_env.render import EpisodeView, Marker, ScenePicture, draw_episode_frame, save_png
    from gavel_env.tasks.driving import drive

    scene = load_scene(record.scene)
    driven = drive(instruction_graph(scene, record), record)
    markers = tuple(Marker(x, y, name) for name, (x, y) in driven.starts.items())
    caption = f"{len(record.reference_plan())} primitives, {driven.metres:.1f} m"
    view = EpisodeView(trail=driven.route(), markers=markers, caption=(record.text, caption))
    save_png(draw_episode_frame(ScenePicture(scene, pixels_per_m=pixels_per_m, caption_lines=5), view), path)
    print(f"\n{path}: {caption}")


def _validate(arguments: argparse.Namespace) -> int:
    from gavel_env.tasks.broken import broken_path, read_broken
    from gavel_env.tasks.certificate import certify_set

    failed = 0
    for path, records in _read(arguments.sets):
        beside = broken_path(path)
        broken = read_broken(beside) if beside.is_file() else None
        for rejected in records.rejected:
            print(rejected.reason)
        good = 0
        for _, problems in certify_set(records.values(), broken, executor=not arguments.symbolic):
            good += not problems
            for problem in problems:
                print(problem)
        bad = len(records) - good + len(records.rejected)
        failed += bad
        scope = "symbolically" if arguments.symbolic else "in the executor"
        variants = sum(len(task) for tasks in (broken or {}).values() for task in tasks)
        extra = f", {variants} broken variants end as recorded" if broken is not None and not bad else ""
        print(f"{path.name} ({records.stamp}): {good} certified {scope}, {bad} not{extra}", flush=True)
    return int(failed > 0)


def _generate(arguments: argparse.Namespace) -> int:
    import msgspec

    from gavel_env.instructions.record import scene_from
    from gavel_env.tasks.generator import Knobs, generate
    from gavel_env.tasks.recipes import house_names

    knobs = Knobs(
        kind=arguments.kind,
        count=arguments.n,
        seed=arguments.seed,
        houses=house_names(arguments.houses),
        tasks=arguments.tasks,
        rooms=arguments.rooms_spread,
        horizon=arguments.horizon,
        surprise=arguments.surprise,
        say_room=arguments.say_room,
        distractors=arguments.distractors,
        split=arguments.split,
        any_pairs=arguments.any_pairs,
    )
    folder = Path() if arguments.out is None else arguments.out.parent
    lines = [msgspec.json.encode(scene_from(record, folder)) + b"\n" for record in generate(knobs)]
    if arguments.out is None:
        sys.stdout.buffer.write(b"".join(lines))
        return 0
    arguments.out.write_bytes(b"".join(lines))
    print(f"{arguments.out}: {len(lines)} certified instructions; try: gavel eval --instructions {arguments.out}")
    return 0
