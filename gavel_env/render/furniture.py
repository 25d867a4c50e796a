"""Furniture seen from above: a rounded footprint in the colour of its kind, a few strokes that tell what it is."""

from __future__ import annotations

import math
from collections.abc import Callable

from gavel_env.house.scenes import Furniture, Scene
from gavel_env.render.canvas import Canvas, Place, softened
from gavel_env.render.style import INK, KIND_COLOURS, PAPER, Kind, Rgb, kind_of

__all__ = ["draw_furniture", "drawing_order"]

_LINE_M = 0.014
_SMALLEST_FIXTURE_M = 0.2  # switches, sockets and alarms are left out
_FLAT_PLANT_M, _TALL_PLANT_M = 0.15, 1.9
_THIN_M = 0.14  # wall-mounted pieces up to this depth are drawn solid


def _mix(first: Rgb, second: Rgb, share: float) -> Rgb:
    """Return the colour `share` of the way from the first to the second."""
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(first, second, strict=True))
    return red, green, blue


def drawing_order(scene: Scene) -> list[Furniture]:
    """Return the pieces from the lowest layer to the highest: carpets, floor, what stands on it, walls, ceiling."""

    def layer(piece: Furniture) -> tuple[int, float, str]:
        if piece.mount in ("carpet", "structure"):
            return 0, piece.z, piece.id
        if piece.mount == "floor":
            return (1 if piece.on is None else 2), piece.z + piece.size_m[2], piece.id
        return (3 if piece.mount == "wall" else 4), piece.z, piece.id

    return sorted(scene.furniture, key=layer)


def draw_furniture(canvas: Canvas, scene: Scene) -> None:
    """Draw the shadows and then every piece."""
    pieces = drawing_order(scene)
    _draw_shadows(canvas, [piece for piece in pieces if piece.blocks])
    for piece in pieces:
        if piece.mount == "floor" or max(piece.size_m[:2]) >= _SMALLEST_FIXTURE_M:
            _draw_piece(canvas, piece)


def _draw_shadows(canvas: Canvas, pieces: list[Furniture]) -> None:
    outlines = []
    for piece in pieces:
        shift = 0.015 + 0.035 * min(piece.size_m[2], 2.0)
        place = Place(piece.x + shift * 0.7, piece.y + shift, piece.yaw)
        shape = place.oval if kind_of(piece.category) in (Kind.PLANT, Kind.LAMP) else place.box
        outlines.append(shape(0, 0, piece.size_m[0], piece.size_m[1]))
    canvas.blend(softened(canvas.mask(*outlines), 0.035 * canvas.view.pixels_per_m), INK, 0.34)


def _draw_piece(canvas: Canvas, piece: Furniture) -> None:
    kind = kind_of(piece.category)
    place = Place(piece.x, piece.y, piece.yaw)
    depth, width = piece.size_m[0], piece.size_m[1]
    colour = KIND_COLOURS[kind]
    if piece.mount == "carpet" or kind is Kind.CARPET:
        _draw_carpet(canvas, place, depth, width, colour)
    elif kind is Kind.PLANT:
        _draw_plant(canvas, place, piece, colour)
    elif kind is Kind.LAMP and piece.mount == "floor":
        _draw_lamp(canvas, place, piece, colour)
    elif piece.mount == "ceiling":
        size = min(depth, width, 0.35)
        canvas.line(place.oval(0, 0, size, size), _mix(colour, INK, 0.35), _LINE_M, closed=True)
        canvas.polygon(place.oval(0, 0, size * 0.45, size * 0.45), colour, 0.8)
    elif piece.mount == "wall" and depth > _THIN_M:
        # Overhead, as draughtsmen have it: see-through, with a dashed rim.
        canvas.polygon(place.box(0, 0, depth, width, 0.02), colour, 0.3)
        _dashes(canvas, place.box(0, 0, depth, width), _mix(colour, INK, 0.55))
    else:
        radius = 0.06 if min(depth, width) > 0.3 else 0.02
        outline = place.box(0, 0, depth, width, radius)
        canvas.polygon(outline, colour)
        _GLYPHS.get(kind, _plain)(canvas, place, piece, colour)
        canvas.line(outline, _mix(colour, INK, 0.55), _LINE_M, closed=True)
        if kind in _WITH_FRONT and min(depth, width) > 0.3:
            tip, base = depth / 2 - 0.025, depth / 2 - 0.075
            marker = [place.world(tip, 0), place.world(base, 0.045), place.world(base, -0.045)]
            canvas.polygon(marker, _mix(colour, INK, 0.6))


def _dashes(canvas: Canvas, corners: list[tuple[float, float]], colour: Rgb) -> None:
    for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True):
        length_m = ((bx - ax) ** 2 + (by - ay) ** 2) ** 0.5
        count = max(1, round(length_m / 0.12))
        for i in range(count):
            start, end = i / count, (i + 0.55) / count
            ends = [(ax + (bx - ax) * t, ay + (by - ay) * t) for t in (start, end)]
            canvas.line(ends, colour, _LINE_M)


def _draw_carpet(canvas: Canvas, place: Place, depth: float, width: float, colour: Rgb) -> None:
    canvas.polygon(place.box(0, 0, depth, width, 0.03), colour, 0.62)
    for inset, share in ((0.06, 0.75), (0.14, 0.45)):
        if min(depth, width) > 4 * inset:
            rim = place.box(0, 0, depth - 2 * inset, width - 2 * inset, 0.02)
            canvas.line(rim, _mix(colour, PAPER, share), 0.02, closed=True)
    step = 0.22
    if min(depth, width) > 0.9:
        for i in range(1, int((depth - 0.4) / step)):
            for j in range(1, int((width - 0.4) / step)):
                if (i + j) % 2:
                    u, v = -depth / 2 + 0.2 + i * step, -width / 2 + 0.2 + j * step
                    diamond = [place.world(u + a, v + b) for a, b in ((0.035, 0), (0, 0.035), (-0.035, 0), (0, -0.035))]
                    canvas.polygon(diamond, _mix(colour, PAPER, 0.5), 0.8)


def _plain(canvas: Canvas, place: Place, piece: Furniture, colour: Rgb) -> None:
    depth, width = piece.size_m[0], piece.size_m[1]
    if min(depth, width) > 0.25:
        canvas.polygon(place.box(0, 0, depth - 0.1, width - 0.1, 0.04), _mix(colour, PAPER, 0.28))


def _storage(canvas: Canvas, place: Place, piece: Furniture, colour: Rgb) -> None:
    depth, width = piece.size_m[0], piece.size_m[1]
    if depth < 0.12:
        return
    canvas.polygon(place.box(-0.015, 0, depth - 0.09, width - 0.06, 0.01), _mix(colour, PAPER, 0.22))
    bays = max(1, round(width / 0.55))
    dark = _mix(colour, INK, 0.4)
    for bay in range(1, bays):
        v = -width / 2 + width * bay / bays
        canvas.line([place.world(-depth / 2, v), place.world(depth / 2, v)], dark, 0.01)
    if {"bookcase", "shelf"} & set(piece.category.split("_")):
        count = int(width / 0.07)
        for i in range(1, count):
            shade = _mix(colour, INK if i % 3 else PAPER, 0.3 + 0.1 * (i * 7 % 4))
            canvas.polygon(place.box(-0.02, -width / 2 + i * width / count, depth * 0.55, 0.032), shade)


def _appliance(canvas: Canvas, place: Place, piece: Furniture, colour: Rgb) -> None:
    depth, width = piece.size_m[0], piece.size_m[1]
    dark, light = _mix(colour, INK, 0.55), _mix(colour, PAPER, 0.45)
    name = set(piece.category.split("_"))
    if name & {"oven", "stove", "burner", "grill", "cooktop"} and not name & {"toaster"}:
        canvas.polygon(place.box(-0.03, 0, depth - 0.16, width - 0.08, 0.03), _mix(colour, INK, 0.35))
        size = min(depth, width) * 0.3
        for su in (-1, 1):
            for sv in (-1, 1):
                ring = place.oval(su * depth * 0.2 - 0.03, sv * width * 0.22, size, size)
                canvas.line(ring, light, 0.018, closed=True)
    elif name & {"washer", "dryer"}:
        size = min(depth, width) * 0.58
        canvas.polygon(place.oval(0, 0, size, size), light)
        canvas.line(place.oval(0, 0, size, size), dark, 0.018, closed=True)
    else:
        canvas.polygon(place.box(-0.02, 0, depth - 0.12, width - 0.06, 0.03), light)
        front = depth / 2 - 0.04
        canvas.line([place.world(front, -width * 0.42), place.world(front, width * 0.42)], dark, 0.02)


def _seat(canvas: Canvas, place: Place, piece: Furniture, colour: Rgb) -> None:
    depth, width = piece.size_m[0], piece.size_m[1]
    light, dark = _mix(colour, PAPER, 0.28), _mix(colour, INK, 0.3)
    name = set(piece.category.split("_"))
    if name & {"stool", "taboret", "ottoman", "pouf", "bench"}:
        canvas.polygon(place.box(0, 0, depth - 0.08, width - 0.08, 0.12), light)
        return
    back = min(0.22, depth * 0.24)
    arms = min(0.18, width * 0.16) if name & {"sofa", "armchair", "couch"} else 0.0
    canvas.polygon(place.box(-depth / 2 + back / 2, 0, back, width, 0.05), dark)
    for side in (-1, 1):
        if arms:
            canvas.polygon(place.box(0.0, side * (width / 2 - arms / 2), depth, arms, 0.05), dark)
    seats = max(1, round((width - 2 * arms) / 0.75)) if arms else 1
    span = (width - 2 * arms) / seats
    for i in range(seats):
        v = -width / 2 + arms + span * (i + 0.5)
        canvas.polygon(place.box(back / 2, v, depth - back - 0.05, span - 0.04, 0.07), light)


def _bed(canvas: Canvas, place: Place, piece: Furniture, colour: Rgb) -> None:
    depth, width = piece.size_m[0], piece.size_m[1]
    canvas.polygon(place.box(0, 0, depth - 0.08, width - 0.08, 0.06), (244, 240, 236))
    blanket = depth * 0.66
    canvas.polygon(place.box(depth / 2 - blanket / 2, 0, blanket, width, 0.06), colour)
    fold = depth / 2 - blanket
    canvas.polygon(place.box(fold + 0.09, 0, 0.18, width, 0.02), _mix(colour, PAPER, 0.45))
    pillows = 2 if width > 1.2 else 1
    for i in range(pillows):
        v = (i - (pillows - 1) / 2) * width * 0.46
        pillow = place.box(-depth / 2 + depth * 0.15, v, depth * 0.17, width * (0.38 if pillows > 1 else 0.6), 0.08)
        canvas.polygon(pillow, PAPER)
        canvas.line(pillow, _mix(colour, PAPER, 0.2), _LINE_M, closed=True)


def _bath(canvas: Canvas, place: Place, piece: Furniture, colour: Rgb) -> None:
    depth, width = piece.size_m[0], piece.size_m[1]
    dark, water = _mix(colour, INK, 0.35), (186, 214, 228)
    name = set(piece.category.split("_"))
    if name & {"toilet", "urinal"}:
        canvas.polygon(place.box(-depth * 0.36, 0, depth * 0.24, width, 0.03), _mix(colour, INK, 0.1))
        for size, fill in ((1.0, (252, 252, 252)), (0.66, water)):
            bowl = place.oval(depth * 0.13, 0, depth * 0.66 * size, width * 0.84 * size)
            canvas.polygon(bowl, fill)
            canvas.line(bowl, dark, 0.012, closed=True)
    elif name & {"shower", "showerhead"}:
        canvas.polygon(place.box(0, 0, depth - 0.1, width - 0.1, 0.04), _mix(water, PAPER, 0.4))
        for su, sv in ((1, 1), (1, -1)):
            u, v = su * depth * 0.42, sv * width * 0.42
            canvas.line([place.world(-u, -v), place.world(u, v)], dark, 0.008)
        canvas.polygon(place.oval(0, 0, 0.12, 0.12), dark)
    elif name & {"bathtub", "tub"}:
        canvas.polygon(place.box(0, 0, depth - 0.14, width - 0.14, 0.25), water)
    else:
        basin = place.box(0.03, 0, depth * 0.6, width * 0.72, min(depth, width) * 0.22)
        canvas.polygon(basin, water)
        canvas.line(basin, dark, 0.012, closed=True)
        canvas.line([place.world(-depth * 0.42, 0), place.world(-depth * 0.14, 0)], dark, 0.03)


def _screen(canvas: Canvas, place: Place, piece: Furniture, colour: Rgb) -> None:
    depth, width = piece.size_m[0], piece.size_m[1]
    front = depth / 2 - min(0.02, depth / 4)
    canvas.line([place.world(front, -width * 0.44), place.world(front, width * 0.44)], (150, 206, 232), 0.03)


def _draw_lamp(canvas: Canvas, place: Place, piece: Furniture, colour: Rgb) -> None:
    depth, width = piece.size_m[0], piece.size_m[1]
    canvas.disc((place.x, place.y), max(depth, width) / 2 + 0.12, (255, 236, 170), 0.5)
    shade = place.oval(0, 0, depth, width)
    canvas.polygon(shade, colour)
    canvas.polygon(place.oval(0, 0, depth * 0.5, width * 0.5), (255, 246, 214))
    canvas.line(shade, _mix(colour, INK, 0.55), _LINE_M, closed=True)


def _draw_plant(canvas: Canvas, place: Place, piece: Furniture, colour: Rgb) -> None:
    """Draw a plant as a crown of leaves: see-through if taller than a person; as ground if flat."""
    depth, width, height = piece.size_m
    if height < _FLAT_PLANT_M:
        canvas.polygon(place.box(0, 0, depth, width, 0.1), colour, 0.35)
        return
    alpha = 0.55 if height > _TALL_PLANT_M else 1.0
    lobes = 7
    for ring, (share, mix) in enumerate(((0.31, 0.12), (0.17, -0.14))):
        for i in range(lobes):
            angle = 2 * math.pi * (i + 0.5 * ring) / lobes
            u, v = share * depth * math.cos(angle), share * width * math.sin(angle)
            leaf = place.oval(u, v, depth * (0.38 - 0.1 * ring), width * (0.38 - 0.1 * ring))
            shade = mix + 0.06 * (i % 2)
            canvas.polygon(leaf, _mix(colour, INK if shade > 0 else PAPER, abs(shade)), alpha)
    canvas.polygon(place.oval(0, 0, min(depth * 0.16, 0.35), min(width * 0.16, 0.35)), _mix(colour, INK, 0.4), alpha)


_WITH_FRONT = frozenset({Kind.STORAGE, Kind.APPLIANCE})

_GLYPHS: dict[Kind, Callable[[Canvas, Place, Furniture, Rgb], None]] = {
    Kind.STORAGE: _storage,
    Kind.APPLIANCE: _appliance,
    Kind.SEAT: _seat,
    Kind.BED: _bed,
    Kind.BATH: _bath,
    Kind.SCREEN: _screen,
}
