"""Frames of an episode over a finished picture of its scene: seen floor, routes, markers, the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from gavel_env.render.canvas import Canvas, Image, Place, Viewport, blend_into, text_size, write
from gavel_env.render.picture import ScenePicture
from gavel_env.render.style import ACCENT, INK, PAPER, ROUTE, Rgb

__all__ = ["EpisodeView", "Marker", "RobotPose", "SeenFloor", "draw_episode_frame"]

Point = tuple[float, float]

_ROBOT_COLOUR: Rgb = (32, 96, 168)
_WEDGE_M = 1.3  # drawn length of the camera's wedge; its real range is longer
_CAPTION_SIZE_PX = 14


class RobotPose(NamedTuple):
    """Where the robot stands, metres, and looks, degrees clockwise from +x (as `yaw` in scene files)."""

    x: float
    y: float
    heading_deg: float


class Marker(NamedTuple):
    """A named spot, such as an object that was seen."""

    x: float
    y: float
    label: str
    colour: Rgb = ACCENT


class SeenFloor(NamedTuple):
    """Which cells of the floor were seen.

    Attributes:
        mask: (height, width) bool, True = seen.
        origin: (x, y) of the outer corner of cell [0, 0], metres.
        cell_m: side of a cell.
    """

    mask: NDArray[np.bool_]
    origin: Point
    cell_m: float


@dataclass(frozen=True, kw_only=True)
class EpisodeView:
    """What one frame shows; everything may be left out.

    Attributes:
        robot: its pose.
        radius_m: radius of the robot.
        fov_deg: angle of its camera.
        held: name of what it holds.
        trail: points driven so far, metres.
        route: points yet to be driven, metres.
        markers: named spots.
        seen: floor seen so far; the rest is dimmed.
        caption: lines under the house (needs a picture made with `caption_lines`).
    """

    robot: RobotPose | None = None
    radius_m: float = 0.25
    fov_deg: float = 63.4
    held: str | None = None
    trail: tuple[Point, ...] = ()
    route: tuple[Point, ...] = ()
    markers: tuple[Marker, ...] = ()
    seen: SeenFloor | None = None
    caption: tuple[str, ...] = field(default=())


def draw_episode_frame(picture: ScenePicture, view: EpisodeView) -> Image:
    """Draw one frame over the picture's cached background.

    Args:
        picture: of the scene, made once.
        view: what happens at this moment.

    Returns:
        (height, width, 3) uint8 RGB, a new array.
    """
    image = picture.background.copy() if view.seen is None else _with_unseen_dimmed(picture, view.seen)
    canvas = Canvas(image, picture.view)
    if len(view.trail) > 1:
        _draw_path(canvas, view.trail, ROUTE, 0.05)
    if len(view.route) > 1:
        _draw_dots(canvas, view.route, ROUTE)
    if view.robot is not None:
        _draw_robot(canvas, view.robot, view.radius_m, view.fov_deg)
    _draw_markers(canvas, view.markers)
    if view.robot is not None and view.held:
        x, y = picture.view.pixel(view.robot.x, view.robot.y)
        _draw_chip(
            image, (x + view.radius_m * picture.view.pixels_per_m + 4, y - 9), f"holds {view.held}", _ROBOT_COLOUR
        )
    _draw_caption(image, picture, view.caption)
    return image


def _with_unseen_dimmed(picture: ScenePicture, seen: SeenFloor) -> Image:
    view = picture.view
    cell_px = seen.cell_m * view.pixels_per_m
    left, top = view.pixel(*seen.origin)
    # Centres of cells go to centres of their pixels.
    matrix = np.array([[cell_px, 0, left + (cell_px - 1) / 2], [0, cell_px, top + (cell_px - 1) / 2]])
    mask = seen.mask.astype(np.uint8) * 255
    lit = cv2.warpAffine(mask, matrix, view.size, flags=cv2.INTER_LINEAR)
    image = picture.dimmed.copy()
    cv2.copyTo(picture.background, cv2.threshold(lit, 127, 255, cv2.THRESH_BINARY)[1], image)
    return image


def _draw_path(canvas: Canvas, points: tuple[Point, ...], colour: Rgb, width_m: float) -> None:
    canvas.line(points, PAPER, width_m * 2.2)
    canvas.line(points, colour, width_m)


def _draw_dots(canvas: Canvas, points: tuple[Point, ...], colour: Rgb) -> None:
    """Draw a route yet to be driven as dots 0.22 m apart, its end as a ring."""
    rest = 0.0
    for (ax, ay), (bx, by) in pairwise(points):
        length_m = math.hypot(bx - ax, by - ay)
        along = rest
        while along < length_m:
            share = along / length_m
            spot = (ax + (bx - ax) * share, ay + (by - ay) * share)
            canvas.disc(spot, 0.055, PAPER)
            canvas.disc(spot, 0.038, colour)
            along += 0.22
        rest = along - length_m
    canvas.disc(points[-1], 0.12, PAPER)
    canvas.line(Place(*points[-1], 0).oval(0, 0, 0.2, 0.2), colour, 0.05, closed=True)


def _draw_robot(canvas: Canvas, robot: RobotPose, radius_m: float, fov_deg: float) -> None:
    place = Place(robot.x, robot.y, robot.heading_deg)
    half = math.radians(fov_deg / 2)
    angles = np.linspace(-half, half, 17).tolist()
    wedge = [place.world(0, 0), *(place.world(_WEDGE_M * math.cos(a), _WEDGE_M * math.sin(a)) for a in angles)]
    canvas.polygon(wedge, _ROBOT_COLOUR, 0.2)
    canvas.disc((robot.x + 0.02, robot.y + 0.04), radius_m * 1.06, INK, 0.25)
    canvas.disc((robot.x, robot.y), radius_m, PAPER)
    canvas.disc((robot.x, robot.y), radius_m * 0.86, _ROBOT_COLOUR)
    nose = [place.world(radius_m * u, radius_m * v) for u, v in ((0.66, 0), (-0.38, 0.44), (-0.14, 0), (-0.38, -0.44))]
    canvas.polygon(nose, PAPER)


def _draw_markers(canvas: Canvas, markers: tuple[Marker, ...]) -> None:
    spots = [canvas.view.pixel(marker.x, marker.y) for marker in markers]
    taken = [(x - 8, y - 8, x + 8, y + 8) for x, y in spots]
    for marker, (x, y) in zip(markers, spots, strict=True):
        place = Place(marker.x, marker.y, 45)
        size = 12 / canvas.view.pixels_per_m
        canvas.polygon(place.box(0, 0, size * 1.35, size * 1.35, size * 0.2), PAPER)
        canvas.polygon(place.box(0, 0, size, size, size * 0.2), marker.colour)
        if not marker.label:
            continue
        width, height = text_size(marker.label, 11, 500)[0] + 10, 18
        corners = [(x + 10, y - 9), (x - 10 - width, y - 9), (x - width / 2, y - 30), (x - width / 2, y + 12)]
        boxes = [(left, top, left + width, top + height) for left, top in corners]
        box = next((b for b in boxes if not any(_overlap(b, other) for other in taken)), boxes[0])
        taken.append(box)
        _draw_chip(canvas.image, box[:2], marker.label, marker.colour)


def _overlap(first: tuple[float, float, float, float], second: tuple[float, float, float, float]) -> bool:
    return first[0] < second[2] and second[0] < first[2] and first[1] < second[3] and second[1] < first[3]


def _draw_chip(image: Image, corner: Point, text: str, colour: Rgb) -> None:
    """Write a text on a small rounded plate whose upper left pixel is `corner`."""
    width, height = text_size(text, 11, 500)[0] + 10, 18
    left = round(min(max(corner[0], 2), image.shape[1] - width - 2))
    top = round(min(max(corner[1], 2), image.shape[0] - height - 2))
    if left < 0 or top < 0:
        return
    region = image[top : top + height, left : left + width]
    plate = np.zeros((height, width), np.uint8)
    view = Viewport((0.0, 0.0), 1.0, (0.0, 0.0), (width, height))
    outline = Place((width - 1) / 2, (height - 1) / 2, 0).box(0, 0, width - 2, height - 2, 5)
    plate = Canvas(np.zeros((height, width, 3), np.uint8), view).mask(outline)
    blend_into(region, plate, (255, 253, 248), 0.92)
    Canvas(region, view).line(outline, colour, 1, closed=True)
    write(image, text, (left + 5, top + 13), 11, INK, 500)


def _draw_caption(image: Image, picture: ScenePicture, lines: tuple[str, ...]) -> None:
    """Write the caption, long lines broken at words; the last line always fits in."""
    left, top = picture.caption_at
    room_px = image.shape[1] - 2 * left
    rows: list[tuple[str, int]] = []
    for i, line in enumerate(lines):
        weight = 500 if i == 0 else 400
        broken = _broken(line, room_px, weight)
        room = max(1, picture.caption_lines - len(rows) - (len(lines) - 1 - i))
        if len(broken) > room:
            broken = [*broken[: room - 1], _cut(" ".join(broken[room - 1 :]), room_px, weight)]
        rows += [(text, weight) for text in broken]
    for i, (text, weight) in enumerate(rows[: picture.caption_lines]):
        write(image, text, (left, top + 16 + 22 * i), _CAPTION_SIZE_PX, INK, weight)


def _broken(line: str, room_px: int, weight: int) -> list[str]:
    """Break a line at words so that each part is at most `room_px` wide."""
    parts = [""]
    for word in line.split():
        longer = f"{parts[-1]} {word}".strip()
        if parts[-1] and text_size(longer, _CAPTION_SIZE_PX, weight)[0] > room_px:
            parts.append(word)
        else:
            parts[-1] = longer
    return parts


def _cut(line: str, room_px: int, weight: int) -> str:
    """Shorten a line with an ellipsis until it is at most `room_px` wide."""
    shown = line
    while text_size(shown, _CAPTION_SIZE_PX, weight)[0] > room_px and len(shown) > 2:
        shown = shown[:-2].rstrip() + "…"
    return shown
