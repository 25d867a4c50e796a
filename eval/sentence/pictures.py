"""Pictures of a sentence carried out: the replay page, the whole drive as a picture, and the drive as an animation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from eval.records.journal import RecordFile
from eval.report.html import html_report
from eval.sentence.drive import Moment
from gavel_env.errors import DataError, NotInstalled
from gavel_env.house.floor_map import FloorMap
from gavel_env.house.scenes import load_scene
from gavel_env.render import EpisodeView, Marker, RobotPose, ScenePicture, draw_episode_frame, save_png
from gavel_env.render.canvas import Image
from gavel_env.render.episode import SeenFloor

if TYPE_CHECKING:
    from eval.sentence.run import SentenceRun

__all__ = ["animation", "picture", "replay", "save"]

_PICTURE_PX_PER_M = 60.0
_ANIMATION_PX_PER_M = 36.0
_STRIDE_M = 0.5
_DRIVING_MS, _DOING_MS, _END_MS = 90, 700, 3000


class Frame(NamedTuple):
    """A picture of an animation, and how long it stands."""

    image: Image
    ms: int


def replay(run: SentenceRun) -> str:
    """Return the replay as one HTML file."""
    files = RecordFile((), {run.record.key: run.record}, (), (Path(run.scene).parent,))
    return html_report(files, title=run.text, tables=False)


def picture(run: SentenceRun) -> Image:
    """Return the house with the whole drive, and where the things stood at the start."""
    markers = tuple(Marker(x, y, f"{name} at the start") for name, (x, y) in run.driven.spots.items())
    last = run.driven.moments[-1].observed
    layout = last.layout
    cells = [cell for moment in run.driven.moments for cell in moment.route]
    view = EpisodeView(
        robot=_pose(layout, last.cell, last.heading_deg),
        radius_m=layout.robot.robot_radius_m,
        fov_deg=layout.robot.camera_fov_deg,
        held=last.graph.holding,
        trail=tuple(map(layout.point, cells)),
        markers=markers,
        caption=(run.text, f"{run.record.outcome}, {len(run.record.steps)} steps, {run.record.metres:.1f} m"),
    )
    return draw_episode_frame(
        ScenePicture(load_scene(run.scene), pixels_per_m=_PICTURE_PX_PER_M, caption_lines=4), view
    )


def animation(run: SentenceRun) -> Iterator[Frame]:
    """Yield the frames of the drive: what has been seen comes out of the dark as the robot goes."""
    moments = run.driven.moments
    picture = ScenePicture(load_scene(run.scene), pixels_per_m=_ANIMATION_PX_PER_M, caption_lines=3)
    trail: list[tuple[float, float]] = []
    yield Frame(draw_episode_frame(picture, _view(run, moments[0], trail, "")), _DOING_MS)
    for (before, after), step in zip(pairwise(moments), run.record.steps, strict=True):
        layout = after.observed.layout
        stride = max(1, round(_STRIDE_M / layout.robot.cell_m))
        for at in range(0, max(len(after.route) - 1, 0), stride):
            here, there = after.route[at], after.route[min(at + stride, len(after.route) - 1)]
            trail += map(layout.point, after.route[at : at + stride])
            pose = _pose(layout, here, _heading(layout, here, there))
            yield Frame(draw_episode_frame(picture, _view(run, before, trail, step.action, pose)), _DRIVING_MS)
        last = after is moments[-1]
        said = f"{step.action}: {step.outcome}" if step.outcome != "ok" else step.action
        yield Frame(draw_episode_frame(picture, _view(run, after, trail, said)), _END_MS if last else _DOING_MS)


def _view(
    run: SentenceRun, moment: Moment, trail: list[tuple[float, float]], doing: str, pose: RobotPose | None = None
) -> EpisodeView:
    observed = moment.observed
    layout, graph = observed.layout, observed.graph
    things = [put.placement.id for put in run.put if put.placement.id in graph.world.nodes]
    return EpisodeView(
        robot=pose or _pose(layout, observed.cell, observed.heading_deg),
        radius_m=layout.robot.robot_radius_m,
        fov_deg=layout.robot.camera_fov_deg,
        held=graph.holding,
        trail=tuple(trail),
        markers=tuple(Marker(*observed.positions[o], o) for o in things if o is not None and o != graph.holding),
        seen=SeenFloor(moment.seen, layout.origin_m, layout.robot.cell_m),
        caption=(run.text, f"{doing}  ·  {observed.metres:.1f} m" if doing else "start"),
    )


def _pose(layout: FloorMap, cell: int, heading_deg: float) -> RobotPose:
    x, y = layout.point(cell)
    return RobotPose(x, y, heading_deg)


def _heading(layout: FloorMap, here: int, there: int) -> float:
    (x0, y0), (x1, y1) = layout.point(here), layout.point(there)
    return math.degrees(math.atan2(y1 - y0, x1 - x0))


def save(
    run: SentenceRun, *, html: str | Path | None = None, png: str | Path | None = None, gif: str | Path | None = None
) -> None:
    """Write the files that are asked for.

    Raises:
        DataError: a file cannot be written.
        NotInstalled: a GIF is asked for without Pillow.
    """
    try:
        if html is not None:
            Path(html).write_text(replay(run), "utf-8")
        if png is not None:
            save_png(picture(run), Path(png))
        if gif is not None:
            _save_animation(run, Path(gif))
    except OSError as error:
        raise DataError(f"{error.filename} cannot be written: {error.strerror}") from error


def _save_animation(run: SentenceRun, path: Path) -> None:
    """Write an animation: WebP by OpenCV; GIF, whose 256 colours OpenCV chooses badly, by Pillow."""
    if path.suffix == ".webp":
        _save_webp(list(animation(run)), path)
    else:
        _save_gif(list(animation(run)), path)


def _save_webp(frames: Sequence[Frame], path: Path) -> None:
    path.write_bytes(b"")  # says what is wrong with the path, which OpenCV does not
    film = cv2.Animation()
    film.frames = [np.ascontiguousarray(frame.image[:, :, ::-1]) for frame in frames]
    film.durations = [frame.ms for frame in frames]
    cv2.imwriteanimation(str(path), film, [cv2.IMWRITE_WEBP_QUALITY, 85])


def _save_gif(frames: Sequence[Frame], path: Path) -> None:
    """Write a GIF whose frames share one palette, so that what does not change costs nothing."""
    try:
        from PIL import Image as Pillow
    except ImportError as error:
        raise NotInstalled("a GIF needs Pillow: pip install 'gavel-env[gif]', or name the file .webp") from error
    colours = Pillow.fromarray(np.concatenate([frames[0].image, frames[-1].image])).quantize(192)
    pictures = (Pillow.fromarray(frame.image) for frame in frames)
    first, *others = (p.quantize(palette=colours, dither=Pillow.Dither.NONE) for p in pictures)
    durations = [frame.ms for frame in frames]
    first.save(path, format="GIF", save_all=True, append_images=others, duration=durations, loop=0, optimize=False)
