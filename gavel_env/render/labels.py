"""Names on the picture: rooms on free floor, pieces on their footprints, nothing on top of anything else."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from gavel_env.house.scenes import Furniture, Scene
from gavel_env.render.canvas import Canvas, Mask, Place, stamp, text_size
from gavel_env.render.canvas import font as typeface
from gavel_env.render.floor import door_leaf
from gavel_env.render.furniture import drawing_order
from gavel_env.render.style import INK, INK_SOFT, KIND_COLOURS, Kind, Rgb, floor_of, kind_of, room_title, words
from gavel_env.world_model.ontology import category_of

__all__ = ["draw_labels"]

_PAD = 2  # pixels kept free around a text
_UNNAMED = frozenset({Kind.OPENING, Kind.CARPET})


class _Line(NamedTuple):
    text: str
    size: int
    weight: int


class _Block(NamedTuple):
    """Lines of text, centred, as a mask of letters ready to be stamped."""

    letters: Mask

    @property
    def height(self) -> int:
        return int(self.letters.shape[0])

    @property
    def width(self) -> int:
        return int(self.letters.shape[1])


def _block(lines: tuple[_Line, ...], upright: bool = False) -> _Block:
    """Set lines of text; `upright` turns them to be read from below."""
    boxes = [text_size(*line) for line in lines]
    leading = [round((0.42 if line.size < before.size else 0.28) * before.size) for before, line in pairwise(lines)]
    width = max(box[0] for box in boxes) + 2
    height = sum(box[1] for box in boxes) + sum(leading) + boxes[-1][2]
    tile = np.zeros((height + 2 * lines[0].size, width + 2 * lines[0].size, 3), np.uint8)
    top = left = lines[0].size
    row = top
    for i, (line, (line_width, ascent, _)) in enumerate(zip(lines, boxes, strict=True)):
        row += ascent + (leading[i - 1] if i else 0)
        at = (left + (width - line_width) // 2, row)
        cv2.putText(tile, line.text, at, (255, 255, 255), typeface(), line.size, line.weight)
    letters = np.ascontiguousarray(tile[top - 1 : top + height, left : left + width, 0])
    return _Block(np.ascontiguousarray(np.rot90(letters)) if upright else letters)


def _fit(free: NDArray[np.bool_], block: _Block, near: tuple[float, float]) -> tuple[int, int] | None:
    """Return where the block's centre can lie.

    Args:
        free: (height, width) bool, True where text may lie.
        block: what is to lie there.
        near: wished (column, row) of its centre.

    Returns:
        (column, row) nearest to the wish, or None if it fits nowhere.
    """
    height, width = block.height + 2 * _PAD, block.width + 2 * _PAD
    if height > free.shape[0] or width > free.shape[1]:
        return None
    total = cv2.integral(free.astype(np.uint8))
    inside = total[height:, width:] - total[:-height, width:] - total[height:, :-width] + total[:-height, :-width]
    rows, columns = np.nonzero(inside == height * width)
    if not len(rows):
        return None
    distance = (columns + width / 2 - near[0]) ** 2 + (rows + height / 2 - near[1]) ** 2
    best = int(np.argmin(distance))
    return int(columns[best]) + width // 2, int(rows[best]) + height // 2


class _Region(NamedTuple):
    """A part of the picture: where it begins, and where in it text may lie."""

    left: int
    top: int
    free: NDArray[np.bool_]


def _window(image: NDArray[np.generic], points: NDArray[np.float64], grow: int) -> tuple[int, int, int, int]:
    """Return (left, top, right, bottom) of the pixels around some points, inside the picture."""
    height, width = image.shape[:2]
    low, high = np.floor(points.min(axis=0)) - grow, np.ceil(points.max(axis=0)) + grow + 1
    left, right = np.clip((low[0], high[0]), 0, width)
    top, bottom = np.clip((low[1], high[1]), 0, height)
    return int(left), int(top), int(right), int(bottom)


class _Writer:
    """Places texts one after the other and remembers what is taken.

    Attributes:
        image: the finished picture, written on in place.
        view: its map from metres to pixels.
        top: (height, width) int32, 1 + index in `order` of the uppermost piece at each pixel, 0 = bare floor.
        room: (height, width) int32, 1 + index of the room at each pixel, 0 = none.
    """

    def __init__(self, canvas: Canvas, scene: Scene) -> None:
        self.image, self.view = canvas.image, canvas.view
        self.scene = scene
        self.taken = np.zeros(self.image.shape[:2], np.bool_)
        self.order = [piece for piece in drawing_order(scene) if piece.mount != "ceiling"]
        self.top = np.zeros(self.image.shape[:2], np.int32)
        self.room = np.zeros(self.image.shape[:2], np.int32)
        for i, room in enumerate(scene.rooms):
            cv2.fillPoly(self.room, [np.round(self.pixels(room.polygon)).astype(np.int32)], i + 1)
        for i, piece in enumerate(self.order):
            if kind_of(piece.category) is not Kind.CARPET:
                cv2.fillPoly(self.top, [np.round(self.footprint(piece)).astype(np.int32)], i + 1)
        # Names stay off door leaves and lamps on the ceiling as well.
        self.bare = (self.top == 0) & (self.room > 0)
        for opening in scene.openings:
            leaf = door_leaf(opening, scene)
            if leaf:
                self._block_out(self.pixels(leaf))
        for piece in scene.furniture:
            if piece.mount == "ceiling":
                size = min(*piece.size_m[:2], 0.35)
                self._block_out(self.pixels(Place(piece.x, piece.y, 0).box(0, 0, size, size)))

    def _block_out(self, outline: NDArray[np.float64]) -> None:
        left, top, right, bottom = _window(self.taken, outline, 0)
        part = np.zeros((bottom - top, right - left), np.uint8)
        cv2.fillPoly(part, [np.round(outline - (left, top)).astype(np.int32)], 1)
        self.bare[top:bottom, left:right] &= part == 0

    def pixels(self, points: Sequence[tuple[float, float]]) -> NDArray[np.float64]:
        """Return points as (n, 2) pixel coordinates."""
        return np.array([self.view.pixel(x, y) for x, y in points])

    def footprint(self, piece: Furniture) -> NDArray[np.float64]:
        """Return the corners of a piece as (4, 2) pixel coordinates."""
        return self.pixels(Place(piece.x, piece.y, piece.yaw).box(0, 0, piece.size_m[0], piece.size_m[1]))

    def place(self, block: _Block, region: _Region, wish: tuple[float, float], colour: Rgb, halo: Rgb | None) -> bool:
        """Write the block in the region where nothing is written yet; return whether it fitted."""
        height, width = region.free.shape
        rows, columns = slice(region.top, region.top + height), slice(region.left, region.left + width)
        free = region.free & ~self.taken[rows, columns]
        at = _fit(free, block, (wish[0] - region.left, wish[1] - region.top))
        if at is None:
            return False
        left, top = at[0] + region.left - block.width // 2, at[1] + region.top - block.height // 2
        stamp(self.image, block.letters, (left, top), colour, halo)
        rows = slice(max(top - _PAD, 0), top + block.height + _PAD)
        self.taken[rows, max(left - _PAD, 0) : left + block.width + _PAD] = True
        return True


def draw_labels(canvas: Canvas, scene: Scene) -> None:
    """Write the names of rooms and pieces on a finished picture (final size, not supersampled)."""
    writer = _Writer(canvas, scene)
    _name_rooms(writer)
    _name_pieces(writer)


def _name_rooms(writer: _Writer) -> None:
    rooms = writer.scene.rooms
    types = Counter(room.type for room in rooms)
    largest = int(np.clip(writer.view.pixels_per_m * 0.18, 13, 22))
    for index, room in sorted(enumerate(rooms), key=lambda entry: (entry[1].area_m2, entry[1].id)):
        left, top, right, bottom = _window(writer.top, writer.pixels(room.polygon), 0)
        here = writer.room[top:bottom, left:right] == index + 1
        if not here.any():
            continue
        floor, bare = _Region(left, top, here), _Region(left, top, here & writer.bare[top:bottom, left:right])
        rows, columns = np.nonzero(here)
        centre = (float(columns.mean()) + left, float(rows.mean()) + top)
        title = room_title(room.id, alone=types[room.type] == 1)
        halo = floor_of(room.type).colour
        attempts = [
            (_block(lines, upright), bare)
            for size in range(largest, 8, -1)
            for lines, upright in _room_lines(title, room.area_m2, size)
        ]
        # No bare floor: over the furniture, if only it stays in the room.
        attempts += [(_block((_Line(title, size, 600),)), floor) for size in (12, 10, 9)]
        any(writer.place(block, region, centre, _darker(halo), halo) for block, region in attempts)


def _room_lines(title: str, area_m2: float, size: int) -> Iterator[tuple[tuple[_Line, ...], bool]]:
    """Yield the ways to set a room's name at one size, and whether it is turned upright."""
    area = _Line(f"{area_m2:.1f} m²", max(9, round(size * 0.62)), 400)
    name = _Line(title, size, 600)
    yield (name, area), False
    for parts in _broken(title)[:1]:
        yield (*(_Line(part, size, 600) for part in parts), area), False
    if size < 15:
        yield (name,), False
        yield (name,), True


def _darker(colour: Rgb) -> Rgb:
    red, green, blue = (round(c * 0.3 + k * 0.2) for c, k in zip(colour, INK, strict=True))
    return red, green, blue


def _name_pieces(writer: _Writer) -> None:
    names = Counter(piece.category for piece in writer.scene.furniture)
    room_index = {room.id: i + 1 for i, room in enumerate(writer.scene.rooms)}
    scale = writer.view.pixels_per_m
    largest = int(np.clip(scale * 0.125, 10, 14))
    homeless = []
    by_area = sorted(enumerate(writer.order), key=lambda e: (-e[1].size_m[0] * e[1].size_m[1], e[1].id))
    for index, piece in by_area:
        if kind_of(piece.category) in _UNNAMED or piece.mount == "structure":
            continue
        left, top, right, bottom = _window(writer.top, writer.footprint(piece), 0)
        region = _Region(left, top, writer.top[top:bottom, left:right] == index + 1)
        if not _name_inside(writer, piece, region, _wordings(piece, names), largest):
            homeless.append(piece)
    for piece in homeless:
        if piece.mount == "wall" or max(piece.size_m[:2]) * scale < 12:
            continue
        left, top, right, bottom = _window(writer.top, writer.footprint(piece), round(0.5 * scale))
        here = writer.room[top:bottom, left:right] == room_index[piece.room]
        region = _Region(left, top, here & writer.bare[top:bottom, left:right])
        halo = floor_of(writer.scene.rooms[room_index[piece.room] - 1].type).colour
        text = _wordings(piece, names)[0]
        blocks = [_block(tuple(_Line(part, 9, 400) for part in lines)) for lines in [(text,), *_broken(text)]]
        wish = writer.view.pixel(piece.x, piece.y)
        any(writer.place(block, region, wish, INK_SOFT, halo) for block in blocks)


def _wordings(piece: Furniture, names: Counter[str]) -> list[str]:
    """Return the name of a piece, longest wording first; numbered if the scene has several of its category."""
    number = piece.id.removeprefix(category_of(piece.id)).removeprefix("_")
    suffix = f" {number}" if names[piece.category] > 1 and number else ""
    full = words(piece.category)
    wordings = [full + suffix]
    if " " in full:
        wordings.append(full.rsplit(" ", 1)[1] + suffix)
    return wordings


def _broken(text: str) -> list[tuple[str, ...]]:
    """Return the ways to break a text into two or three lines."""
    parts = text.split(" ")
    if parts[-1].isdigit() and len(parts) > 1:
        parts = [*parts[:-2], f"{parts[-2]} {parts[-1]}"]
    ways: list[tuple[str, ...]] = [
        (" ".join(parts[:cut]), " ".join(parts[cut:])) for cut in range(len(parts) - 1, 0, -1)
    ]
    ways.sort(key=lambda way: max(map(len, way)))
    if len(parts) == 3:
        ways.append((parts[0], parts[1], parts[2]))
    return ways


def _name_inside(writer: _Writer, piece: Furniture, region: _Region, wordings: list[str], largest: int) -> bool:
    """Write a piece's name on its footprint: as large as fits, in one line, broken, or turned upright."""
    if not region.free.any():
        return False
    ground = KIND_COLOURS[kind_of(piece.category)]
    dark = sum(ground) < 3 * 125
    colour: Rgb = (240, 236, 228) if dark else INK
    halo = ground if dark else _lighter(ground)
    wish = writer.view.pixel(piece.x, piece.y)
    height, width = region.free.shape
    for text in wordings:
        layouts = [(text,), *_broken(text)]
        for size in range(largest, 8, -1):
            for upright in (False, True) if height > 1.4 * width else (False,):
                for lines in layouts:
                    block = _block(tuple(_Line(part, size, 500) for part in lines), upright)
                    if writer.place(block, region, wish, colour, halo):
                        return True
    return False


def _lighter(colour: Rgb) -> Rgb:
    red, green, blue = (round(c + (255 - c) * 0.35) for c in colour)
    return red, green, blue
