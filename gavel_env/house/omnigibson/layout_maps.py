"""Rooms and openings from the layout maps of an OmniGibson scene folder.

Maps are square, 0.01 m per pixel, the world's origin at the image centre: column = x / 0.01 + n / 2, row = y / 0.01 +
n / 2. `floor_insseg_0.png` holds 1 + index of the room instance in the sorted room names, `floor_semseg_0.png` the
1-based line of `metadata/room_categories.txt`, 0 = none; `floor_trav_no_obj_0.png` is 255 where no wall is.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from pathlib import Path
from typing import Any, Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from gavel_env.data import read_bytes
from gavel_env.errors import SceneError
from gavel_env.house.scenes import Opening, RoomOutline

__all__ = ["Layout", "read_layout"]

METRES_PER_PIXEL = 0.01
_MAPS = ("floor_insseg_0.png", "floor_semseg_0.png", "floor_trav_no_obj_0.png")
_INSTANCES, _CATEGORIES, _FREE = _MAPS
_DOORWAY_REACH_PX = 60  # free floor this near to a room and of no room (a doorway's) is counted to it
_SMALLEST_OPENING_M = 0.4
_WIDEST_DOORWAY_M = 1.25
_OUTLINE_TOLERANCE_PX = 1.5
_PNG = b"\x89PNG\r\n\x1a\n"
_IHDR = struct.Struct(">IIB")  # width, height and bits per sample, at the head of every PNG
_MOST_PIXELS_A_SIDE = 10_240  # a hall of 100 m
_MOST_MAP_BYTES = 64 << 20

Labels = NDArray[np.int32]


class Layout(NamedTuple):
    """What the maps say.

    Attributes:
        rooms: outlines, in the order of their ids.
        openings: passages between rooms.
        labels: (n, n) int32, 1 + index of the room at each pixel, 0 = none.
    """

    rooms: tuple[RoomOutline, ...]
    openings: tuple[Opening, ...]
    labels: Labels

    def room_at(self, x: float, y: float) -> str:
        """Return the room whose floor is nearest to a point in metres."""
        size = self.labels.shape[0]
        column, row = (min(max(int(v / METRES_PER_PIXEL + size / 2), 0), size - 1) for v in (x, y))
        if not self.labels[row, column]:
            rows, columns = np.nonzero(self.labels)
            nearest = int(np.argmin((rows - row) ** 2 + (columns - column) ** 2))
            row, column = int(rows[nearest]), int(columns[nearest])
        return self.rooms[int(self.labels[row, column]) - 1].id


def read_layout(folder: Path, named_rooms: frozenset[str], room_categories: Path | None) -> Layout:
    """Read the layout maps of a scene.

    Args:
        folder: the scene's `layout` folder.
        named_rooms: the room names that the scene's objects use.
        room_categories: the data set's `metadata/room_categories.txt`, or None.

    Raises:
        SceneError: a map is missing, unreadable, of another size, or does not fit the room names.
    """
    missing = [name for name in _MAPS if not (folder / name).is_file()]
    if _CATEGORIES in missing and room_categories is None:
        missing.remove(_CATEGORIES)  # room types are then read off the names
    if missing:
        raise SceneError(f"{folder}: {', '.join(missing)} missing; a scene's layout folder has {', '.join(_MAPS)}")
    instances = _read_map(folder / _INSTANCES)
    free = _read_map(folder / _FREE)
    if free.shape != instances.shape:
        sizes = f"{_FREE} is {_size(free)}, {_INSTANCES} is {_size(instances)} pixels"
        raise SceneError(f"{folder}: {sizes}; the maps of a floor have one size")
    types = None
    if room_categories is not None:
        categories = _read_map(folder / _CATEGORIES)
        if categories.shape != instances.shape:
            sizes = f"{_CATEGORIES} is {_size(categories)}, {_INSTANCES} is {_size(instances)} pixels"
            raise SceneError(f"{folder}: {sizes}; the maps of a floor have one size")
        types = _room_types(folder, instances, categories, _category_names(room_categories))
    names = _room_names(folder, instances, named_rooms, types)
    labels = _label_floor(instances, free == 255, list(names))
    rooms = tuple(
        _outline(labels == i + 1, name, types[value] if types else _type_of(name), folder)
        for i, (value, name) in enumerate(names.items())
    )
    return Layout(rooms, _openings(labels, tuple(names.values())), labels)


def _read_map(path: Path) -> NDArray[np.uint8]:
    content = read_bytes(path, "layout map", SceneError, most=_MOST_MAP_BYTES)
    if content[:8] != _PNG or content[12:16] != b"IHDR" or len(content) < _IHDR.size + 16:
        raise SceneError(f"{path} is not a readable PNG")
    width, height, bits = _IHDR.unpack_from(content, 16)
    if max(width, height) > _MOST_PIXELS_A_SIDE or bits > 8:
        limit = f"at most {_MOST_PIXELS_A_SIDE} pixels a side, of 8 bits"
        raise SceneError(f"{path} has {width} x {height} pixels of {bits} bits; {limit}, are read")
    try:
        image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise SceneError(f"{path} is not a readable PNG: {error}") from error
    if image is None:
        raise SceneError(f"{path} is not a readable PNG")
    if image.ndim == 3 and all((image[..., 0] == image[..., channel]).all() for channel in (1, 2)):
        image = image[..., 0]
    if image.ndim != 2 or image.dtype != np.uint8:
        raise SceneError(f"{path}: shape {image.shape}, {image.dtype}; expected one channel of 8 bits")
    if image.shape[0] != image.shape[1]:
        raise SceneError(f"{path} is {_size(image)} pixels; a layout map is square")
    return np.asarray(image, np.uint8)


def _size(image: NDArray[np.generic]) -> str:
    return f"{image.shape[1]} x {image.shape[0]}"


def _type_of(room: str) -> str:
    """Return `living_room` for `living_room_0`."""
    return re.sub(r"_\d+$", "", room)


def _category_names(path: Path) -> list[str]:
    try:
        return read_bytes(path, "room categories", SceneError, most=1 << 20).decode().split()
    except UnicodeDecodeError as error:
        raise SceneError(f"room categories {path} are not UTF-8: {error}") from error


def _room_types(
    folder: Path, instances: NDArray[np.uint8], categories: NDArray[np.uint8], names: list[str]
) -> dict[int, str]:
    """Return the room type of each instance value: the category on most of its pixels."""
    types = {}
    for value in _values(instances):
        counts = np.bincount(categories[instances == value], minlength=2)
        line = int(np.argmax(counts[1:])) + 1 if counts[1:].any() else 0
        if not 1 <= line <= len(names):
            place = f"{folder / _CATEGORIES}: room {value} of {_INSTANCES} has category {line}"
            raise SceneError(f"{place}; room_categories.txt has lines 1 to {len(names)}")
        types[value] = names[line - 1]
    return types


def _values(instances: NDArray[np.uint8]) -> list[int]:
    return [int(value) for value in np.unique(instances) if value]


def _room_names(
    folder: Path, instances: NDArray[np.uint8], named_rooms: frozenset[str], types: dict[int, str] | None
) -> dict[int, str]:
    """Return the room name of each value of the instance map, in the order of the names.

    Value v is the v-th of the sorted room names. The names are those that objects are said to be in; if some room holds
    no object, they are made from the room types instead (`bedroom_0`, `bedroom_1`, … in the order of the values).
    """
    values = _values(instances)
    place = folder / _INSTANCES
    if not values:
        raise SceneError(f"{place} shows no room: every pixel is 0")
    in_order = sorted(named_rooms)
    if values == list(range(1, len(in_order) + 1)):
        names = dict(zip(values, in_order, strict=True))
        wrong = [v for v in values if types is not None and types[v] != _type_of(names[v])]
        if wrong and types is not None:
            said = f"value {wrong[0]} is {types[wrong[0]]!r} in {_CATEGORIES}, and {names[wrong[0]]!r} by the objects"
            raise SceneError(f"{place}: {said}; rooms are numbered in the order of their sorted names")
        return names
    if types is None:
        have = f"has rooms {', '.join(map(str, values))}, the objects name {len(in_order)} ({', '.join(in_order)})"
        raise SceneError(f"{place} {have}; metadata/room_categories.txt beside `scenes` would settle it")
    seen: Counter[str] = Counter()
    names = {}
    for value in values:
        names[value] = f"{types[value]}_{seen[types[value]]}"
        seen[types[value]] += 1
    unknown = sorted(named_rooms - set(names.values()))
    if unknown:
        known = ", ".join(sorted(names.values()))
        raise SceneError(f"{place}: objects are in {unknown[0]!r}, which the maps do not show; they show {known}")
    return dict(sorted(names.items(), key=lambda entry: entry[1]))


def _label_floor(instances: NDArray[np.uint8], free: NDArray[np.bool_], values: list[int]) -> Labels:
    """Label each free pixel with 1 + the index of its room; doorways go to the nearest room, step by step."""
    index = np.zeros(256, np.float32)
    index[values] = np.arange(1, len(values) + 1)
    labels = np.where(free, index[instances], 0).astype(np.float32)
    kernel = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    for _ in range(_DOORWAY_REACH_PX):
        open_floor = free & (labels == 0)
        spread = np.where(open_floor, cv2.dilate(labels, kernel), labels).astype(np.float32)
        if (spread == labels).all():
            break
        labels = spread
    return labels.astype(np.int32)


def _metres(pixels: NDArray[Any], size: int) -> list[tuple[float, float]]:
    """Return the centres of (n, 2) pixels (column, row) in metres."""
    shifted = (np.asarray(pixels, np.float64) + 0.5 - size / 2) * METRES_PER_PIXEL
    return [(round(float(x), 3), round(float(y), 3)) for x, y in shifted]


def _outline(mask: NDArray[np.bool_], name: str, room_type: str, folder: Path) -> RoomOutline:
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not contours:
        raise SceneError(f"{folder}: room {name!r} has no free floor in {_FREE}")
    largest = max(contours, key=cv2.contourArea)
    corners = cv2.approxPolyDP(largest, _OUTLINE_TOLERANCE_PX, True).reshape(-1, 2)
    if len(corners) < 3:
        raise SceneError(f"{folder}: room {name!r} is only {int(mask.sum())} pixels of free floor in {_FREE}")
    area_m2 = round(float(mask.sum()) * METRES_PER_PIXEL**2, 2)
    return RoomOutline(name, room_type, tuple(_metres(corners, mask.shape[0])), area_m2)


def _openings(labels: Labels, names: tuple[str, ...]) -> tuple[Opening, ...]:
    """Return the passages: where free floor of two rooms touches over at least `_SMALLEST_OPENING_M`."""
    touching: dict[tuple[int, int], list[NDArray[np.float64]]] = {}
    for first, second, shift in (
        (labels[:, :-1], labels[:, 1:], (0.5, 0.0)),
        (labels[:-1, :], labels[1:, :], (0.0, 0.5)),
    ):
        rows, columns = np.nonzero((first != second) & (first > 0) & (second > 0))
        low, high = np.minimum(first, second)[rows, columns], np.maximum(first, second)[rows, columns]
        spots = np.stack((columns + shift[0], rows + shift[1]), axis=1)
        for pair in sorted(set(zip(low.tolist(), high.tolist(), strict=True))):
            touching.setdefault(pair, []).append(spots[(low == pair[0]) & (high == pair[1])])
    openings = []
    for (a, b), parts in sorted(touching.items()):
        for cluster in _clusters(np.concatenate(parts), labels.shape[0]):
            segment, width_m = _segment(cluster, labels.shape[0])
            if width_m >= _SMALLEST_OPENING_M:
                kind: Literal["doorway", "open"] = "doorway" if width_m <= _WIDEST_DOORWAY_M else "open"
                openings.append(Opening((names[a - 1], names[b - 1]), segment, round(width_m, 3), kind))
    return tuple(openings)


def _clusters(spots: NDArray[np.float64], size: int) -> list[NDArray[np.float64]]:
    """Split boundary spots (n, 2) into connected runs, from left to right."""
    doubled = np.zeros((2 * size, 2 * size), np.uint8)
    columns, rows = np.round(spots * 2).astype(np.int64).T
    doubled[rows, columns] = 1
    grown = cv2.dilate(doubled, np.ones((5, 5), np.uint8))
    count, marks = cv2.connectedComponents(grown, connectivity=8)
    return [spots[marks[rows, columns] == mark] for mark in range(1, count)]


def _segment(spots: NDArray[np.float64], size: int) -> tuple[tuple[tuple[float, float], tuple[float, float]], float]:
    """Return the straight segment along a run of boundary spots, and its length in metres."""
    centre = spots.mean(axis=0)
    _, _, axes = np.linalg.svd(spots - centre, full_matrices=False)
    direction = axes[0] * np.sign(axes[0][np.argmax(np.abs(axes[0]))])
    along = (spots - centre) @ direction
    ends = np.stack((centre + direction * (along.min() - 0.5), centre + direction * (along.max() + 0.5)))
    first, second = _metres(ends, size)
    return (first, second), float(np.ptp(along) + 1) * METRES_PER_PIXEL
