"""A scene as a picture: house, furniture, names, title, scale bar and legend."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from gavel_env.errors import SceneError
from gavel_env.house.scenes import Scene
from gavel_env.render.canvas import Canvas, Image, Viewport, blend_into, text_size, write
from gavel_env.render.floor import draw_house
from gavel_env.render.furniture import draw_furniture
from gavel_env.render.labels import draw_labels
from gavel_env.render.style import INK, INK_SOFT, KIND_COLOURS, PAPER, Kind, Rgb, kind_of, words

__all__ = ["ScenePicture", "draw_scene", "save_png"]

_SUPERSAMPLING = 2
_LONGEST_SIDE_PX = 1400
_SCALE_RANGE = (16.0, 110.0)  # pixels per metre that are chosen without being asked for
_MARGIN_PX, _HEADER_PX, _BARE_MARGIN_PX = 44, 88, 20
_LEGEND_ROW_PX, _FOOTER_PX, _CAPTION_ROW_PX = 24, 56, 22
_SMALLEST_WIDTH_PX = 560
_DARK: Rgb = (66, 68, 88)  # over floor that was not seen


_MOST_PIXELS_PER_M = 2000.0
_MOST_PIXELS = 100_000_000


class ScenePicture:
    """A scene drawn once, onto which frames are then drawn quickly.

    Args:
        scene: what to draw.
        pixels_per_m: scale; None = such that the longer side of the house is about 1,400 pixels.
        labels: write the names of rooms and pieces.
        legend: add title, scale bar and legend.
        caption_lines: lines of text to keep room for under the house.

    Attributes:
        background: (height, width, 3) uint8 RGB, read-only.
        caption_at: pixel (column, row) of the upper left corner of the room for captions.
        view: the map from metres to pixels of `background`.

    Raises:
        SceneError: the scene has no rooms, or pixels_per_m is not positive.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        pixels_per_m: float | None = None,
        labels: bool = True,
        legend: bool = True,
        caption_lines: int = 0,
    ) -> None:
        if not scene.rooms:
            raise SceneError(f"scene {scene.scene!r} has no rooms; nothing can be drawn")
        if pixels_per_m is not None and not 0 < pixels_per_m <= _MOST_PIXELS_PER_M:
            raise SceneError(f"pixels_per_m is {pixels_per_m}; it must be positive, at most {_MOST_PIXELS_PER_M:g}")
        self.scene = scene
        corners = np.array([point for room in scene.rooms for point in room.polygon])
        low, high = corners.min(axis=0), corners.max(axis=0)
        extent = high - low
        scale = pixels_per_m or float(np.clip(_LONGEST_SIDE_PX / float(extent.max()), *_SCALE_RANGE))
        margin = _MARGIN_PX if legend else _BARE_MARGIN_PX
        width = round(float(extent[0]) * scale) + 2 * margin
        width = max(width, _SMALLEST_WIDTH_PX) if legend else width
        rows = _legend_rows(scene, width - 2 * _MARGIN_PX) if legend else []
        top = _HEADER_PX if legend else margin
        bottom = _FOOTER_PX + _LEGEND_ROW_PX * len(rows) if legend else margin
        house_px = round(float(extent[1]) * scale)
        self.caption_lines = caption_lines
        self.caption_at = (margin, top + house_px + 20)
        caption_px = _CAPTION_ROW_PX * caption_lines + 8 if caption_lines else 0
        height = house_px + top + bottom + caption_px
        if width * height > _MOST_PIXELS:
            raise SceneError(f"the picture would have {width} x {height} pixels; choose fewer pixels_per_m")
        left = (width - float(extent[0]) * scale) / 2
        self.view = Viewport((float(low[0]), float(low[1])), scale, (left, float(top)), (width, height))
        self.background = self._draw(labels, rows, bottom if legend else 0)
        self.background.setflags(write=False)

    @cached_property
    def dimmed(self) -> Image:
        """The background with every floor in the dark, read-only: what is shown of floor not yet seen."""
        image = self.background.copy()
        floor = Canvas(image, self.view).mask(*(room.polygon for room in self.scene.rooms))
        blend_into(image, floor, _DARK, 0.42)
        image.setflags(write=False)
        return image

    def _draw(self, labels: bool, legend: list[list[Kind]], footer_px: int) -> Image:
        large = self.view.scaled(_SUPERSAMPLING)
        sheet = np.empty((large.size[1], large.size[0], 3), np.uint8)
        sheet[:] = PAPER
        canvas = Canvas(sheet, large)
        draw_house(canvas, self.scene)
        draw_furniture(canvas, self.scene)
        image = np.ascontiguousarray(cv2.resize(sheet, self.view.size, interpolation=cv2.INTER_AREA), np.uint8)
        if labels:
            draw_labels(Canvas(image, self.view), self.scene)
        if footer_px:
            self._draw_title(image)
            _draw_footer(image, self.view, legend, footer_px)
        return image

    def _draw_title(self, image: Image) -> None:
        scene = self.scene
        write(image, scene.scene, (_MARGIN_PX, 42), 26, INK, 700)
        area_m2 = sum(room.area_m2 for room in scene.rooms)
        facts = [_count(len(scene.rooms), "room"), f"{area_m2:.0f} m²", _count(len(scene.furniture), "piece")]
        line = " · ".join([*facts, f"{scene.outline} outline"])
        write(image, line, (_MARGIN_PX, 64), 13, INK_SOFT)


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _legend_rows(scene: Scene, width_px: int) -> list[list[Kind]]:
    """Return the kinds that occur, broken into rows that fit."""
    present = {kind_of(piece.category) for piece in scene.furniture}
    rows: list[list[Kind]] = []
    used = width_px
    for kind in (kind for kind in Kind if kind in present):
        needed = _entry_width(kind)
        if used + needed > width_px:
            rows.append([])
            used = 0
        rows[-1].append(kind)
        used += needed
    return rows


def _entry_width(kind: Kind) -> int:
    return text_size(kind.value, 12)[0] + 42


def _draw_footer(image: Image, view: Viewport, legend: list[list[Kind]], footer_px: int) -> None:
    top = view.size[1] - footer_px + 36
    metres = next(m for m in (1, 2, 5, 10, 20, 50) if m * view.pixels_per_m >= 60 or m == 50)
    pixels = round(metres * view.pixels_per_m)
    right = view.size[0] - _MARGIN_PX
    bar_row = 54
    for i in range(4):
        left_end, right_end = right - pixels + pixels * i // 4, right - pixels + pixels * (i + 1) // 4
        image[bar_row : bar_row + 5, left_end:right_end] = INK if i % 2 == 0 else PAPER
    cv2.rectangle(image, (right - pixels, bar_row), (right, bar_row + 4), INK, 1)
    label = f"{metres} m"
    write(image, label, (right - text_size(label, 12)[0], bar_row - 6), 12, INK_SOFT)
    for row in legend:
        column = float(_MARGIN_PX)
        for kind in row:
            colour = KIND_COLOURS[kind]
            swatch = (round(column), top - 11)
            cv2.rectangle(image, swatch, (swatch[0] + 13, swatch[1] + 13), colour, -1)
            cv2.rectangle(image, swatch, (swatch[0] + 13, swatch[1] + 13), INK_SOFT, 1)
            write(image, words(kind.value), (column + 20, top), 12, INK_SOFT)
            column += _entry_width(kind)
        top += _LEGEND_ROW_PX


def draw_scene(scene: Scene, *, pixels_per_m: float | None = None, labels: bool = True, legend: bool = True) -> Image:
    """Draw a scene.

    Args:
        scene: what to draw.
        pixels_per_m: scale; None = such that the longer side of the house is about 1,400 pixels.
        labels: write the names of rooms and pieces.
        legend: add title, scale bar and legend.

    Returns:
        (height, width, 3) uint8 RGB.

    Raises:
        SceneError: the scene has no rooms, or pixels_per_m is not positive.
    """
    return ScenePicture(scene, pixels_per_m=pixels_per_m, labels=labels, legend=legend).background.copy()


def save_png(image: Image, path: str | Path) -> None:
    """Write a picture as a PNG file.

    Args:
        image: (height, width, 3) uint8 RGB.
        path: where to; the folder must exist.

    Raises:
        SceneError: the file cannot be written.
    """
    encoded, data = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    assert encoded, "OpenCV encodes any uint8 picture as PNG"
    try:
        Path(path).write_bytes(data.tobytes())
    except OSError as error:
        raise SceneError(f"picture {path} cannot be written: {error.strerror}") from error
