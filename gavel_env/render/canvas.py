"""Drawing in metres: a supersampled canvas, crisp text, and the map between metres and pixels.

OpenCV alone is used. Its pixel order does not matter here: every array is RGB from the beginning.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gavel_env.render.style import Rgb

__all__ = [
    "Canvas",
    "Image",
    "Mask",
    "Place",
    "Viewport",
    "blend_into",
    "font",
    "softened",
    "stamp",
    "text_size",
    "write",
]

Image = NDArray[np.uint8]  # (height, width, 3) RGB
Mask = NDArray[np.uint8]  # (height, width), 0 or 255 (between: anti-aliased)
Point = tuple[float, float]

_SHIFT = 4  # fractional bits of OpenCV's drawing coordinates


@dataclass(frozen=True)
class Viewport:
    """The map from metres to pixels: pixel = (metres - origin) * pixels_per_m + offset.

    Attributes:
        origin: metres shown at `offset`.
        pixels_per_m: scale.
        offset: pixels of `origin` from the left and the top.
        size: (width, height) of the picture, pixels.
    """

    origin: Point
    pixels_per_m: float
    offset: Point
    size: tuple[int, int]

    def pixel(self, x: float, y: float) -> Point:
        """Return the pixel (column, row) of a point in metres."""
        return (
            (x - self.origin[0]) * self.pixels_per_m + self.offset[0],
            (y - self.origin[1]) * self.pixels_per_m + self.offset[1],
        )

    def shifted(self, left: int, top: int) -> Viewport:
        """Return the same view on the part of the picture that begins at pixel (left, top)."""
        return Viewport(self.origin, self.pixels_per_m, (self.offset[0] - left, self.offset[1] - top), self.size)

    def scaled(self, factor: int) -> Viewport:
        """Return the same view on a picture `factor` times as large."""
        return Viewport(
            self.origin,
            self.pixels_per_m * factor,
            (self.offset[0] * factor, self.offset[1] * factor),
            (self.size[0] * factor, self.size[1] * factor),
        )


@dataclass(frozen=True)
class Place:
    """A local frame on the floor: u along the front of a piece, v across it, both in metres from its centre."""

    x: float
    y: float
    yaw_deg: float

    def world(self, u: float, v: float) -> Point:
        """Return the point (u, v) of this frame in metres of the scene."""
        cos, sin = math.cos(math.radians(self.yaw_deg)), math.sin(math.radians(self.yaw_deg))
        return self.x + u * cos - v * sin, self.y + u * sin + v * cos

    def box(self, u: float, v: float, length_m: float, width_m: float, radius_m: float = 0.0) -> list[Point]:
        """Return the outline of a (rounded) rectangle centred on (u, v), `length_m` along u and `width_m` along v."""
        half_u, half_v = length_m / 2, width_m / 2
        radius = min(radius_m, half_u, half_v)
        if radius <= 0:
            corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
            return [self.world(u + half_u * su, v + half_v * sv) for su, sv in corners]
        outline = []
        for su, sv, start in ((1, 1, 0), (-1, 1, 90), (-1, -1, 180), (1, -1, 270)):
            centre_u, centre_v = u + su * (half_u - radius), v + sv * (half_v - radius)
            for degrees in range(start, start + 91, 15):
                angle = math.radians(degrees)
                outline.append(self.world(centre_u + radius * math.cos(angle), centre_v + radius * math.sin(angle)))
        return outline

    def oval(self, u: float, v: float, length_m: float, width_m: float) -> list[Point]:
        """Return the outline of an ellipse centred on (u, v)."""
        turn = np.linspace(0, 2 * math.pi, 33)[:-1]
        return [self.world(u + length_m / 2 * math.cos(a), v + width_m / 2 * math.sin(a)) for a in turn.tolist()]


class Canvas:
    """An RGB picture that is drawn on in metres, with sub-pixel anti-aliasing.

    Args:
        image: (height, width, 3) uint8 RGB, drawn on in place.
        view: the map from metres to pixels of `image`.
    """

    def __init__(self, image: Image, view: Viewport) -> None:
        self.image = image
        self.view = view

    def _points(self, points: Iterable[Point]) -> NDArray[np.int32]:
        pixels = [self.view.pixel(x, y) for x, y in points]
        return np.round(np.array(pixels) * (1 << _SHIFT)).astype(np.int32).reshape(-1, 1, 2)

    def mask(self, *polygons: Sequence[Point]) -> Mask:
        """Return an anti-aliased mask of the union of polygons."""
        mask = np.zeros(self.image.shape[:2], np.uint8)
        for polygon in polygons:
            cv2.fillPoly(mask, [self._points(polygon)], 255, cv2.LINE_AA, _SHIFT)
        return mask

    def polygon(self, outline: Sequence[Point], colour: Rgb, alpha: float = 1.0) -> None:
        """Fill a polygon."""
        points = self._points(outline)
        if alpha >= 1:
            cv2.fillPoly(self.image, [points], colour, cv2.LINE_AA, _SHIFT)
            return
        region = self._region(points)
        if region is None:
            return
        rows, columns = region
        layer = self.image[rows, columns].copy()
        offset = np.array([columns.start << _SHIFT, rows.start << _SHIFT], np.int32)
        cv2.fillPoly(layer, [points - offset], colour, cv2.LINE_AA, _SHIFT)
        self.image[rows, columns] = cv2.addWeighted(layer, alpha, self.image[rows, columns], 1 - alpha, 0)

    def window(self, points: Iterable[Point], grow_px: int) -> tuple[tuple[slice, slice], tuple[int, int]]:
        """Return the part of the picture around some points: (rows, columns) and its (left, top) pixel."""
        spread = np.full((1, 1, 2), grow_px << _SHIFT, np.int32)
        around = self._points(points)
        region = self._region(np.concatenate((around - spread, around + spread)))
        rows, columns = region if region is not None else (slice(0, 0), slice(0, 0))
        return (rows, columns), (columns.start, rows.start)

    def _region(self, points: NDArray[np.int32]) -> tuple[slice, slice] | None:
        """Return the rows and columns that the points span, one pixel wider, or None if off the picture."""
        height, width = self.image.shape[:2]
        low = (points.reshape(-1, 2).min(axis=0) >> _SHIFT) - 1
        high = (points.reshape(-1, 2).max(axis=0) >> _SHIFT) + 3
        left, top = max(int(low[0]), 0), max(int(low[1]), 0)
        right, bottom = min(int(high[0]), width), min(int(high[1]), height)
        return (slice(top, bottom), slice(left, right)) if left < right and top < bottom else None

    def line(self, points: Sequence[Point], colour: Rgb, width_m: float, closed: bool = False) -> None:
        """Draw a polyline `width_m` wide, at least one pixel."""
        pixels = max(1, round(width_m * self.view.pixels_per_m))
        cv2.polylines(self.image, [self._points(points)], closed, colour, pixels, cv2.LINE_AA, _SHIFT)

    def disc(self, centre: Point, radius_m: float, colour: Rgb, alpha: float = 1.0) -> None:
        """Fill a disc."""
        self.polygon(Place(*centre, 0.0).oval(0, 0, 2 * radius_m, 2 * radius_m), colour, alpha)

    def blend(self, mask: Mask, colour: Rgb, alpha: float) -> None:
        """Blend a colour in where the mask is, by `alpha`."""
        left, top, width, height = cv2.boundingRect(mask)
        region = np.s_[top : top + height, left : left + width]
        if width:
            blend_into(self.image[region], mask[region], colour, alpha)


def softened(mask: Mask, sigma_px: float) -> Mask:
    """Return the mask with a Gaussian rim; wide ones are blurred at a fraction of the size, which looks the same."""
    factor = max(1, int(sigma_px / 3))
    height, width = mask.shape
    small = mask
    if factor > 1:
        size = (max(1, width // factor), max(1, height // factor))
        small = np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_AREA), np.uint8)
    blurred = cv2.GaussianBlur(small, (0, 0), sigma_px / factor)
    return np.asarray(cv2.resize(blurred, (width, height), interpolation=cv2.INTER_LINEAR), np.uint8)


def blend_into(image: Image, mask: Mask, colour: Rgb, alpha: float = 1.0) -> None:
    """Blend a colour into a picture of the mask's size, in place: fixed-point, exact to one level of 255."""
    weight = mask.astype(np.int32)
    if alpha < 1:
        weight = weight * round(alpha * 256) >> 8
    for channel, value in enumerate(colour):
        plane = image[..., channel]
        plane += ((value - plane.astype(np.int32)) * weight // 255).astype(np.uint8)  # modulo 256, as subtraction needs


@cache
def font() -> Any:
    """Return OpenCV's built-in TrueType font."""
    return cv2.FontFace("sans")


@cache
def text_size(text: str, size: int, weight: int = 400) -> tuple[int, int, int]:
    """Return (width, ascent, descent) of a text, pixels; ascent is that of a capital letter."""
    _, _, width, _ = cv2.getTextSize((0, 0), text, (0, 0), font(), size, weight)
    return int(width), round(size * 0.72), round(size * 0.22)


def write(
    image: Image, text: str, at: Point, size: int, colour: Rgb, weight: int = 400, halo: Rgb | None = None
) -> None:
    """Write one line of text.

    Args:
        image: drawn on in place.
        text: what to write.
        at: pixel (column, row) of the left end of the baseline.
        size: font size, pixels.
        colour: of the letters.
        weight: 100 to 900.
        halo: colour of a soft rim that keeps the text legible on a busy ground, or None.
    """
    width, ascent, descent = text_size(text, size, weight)
    column, row = round(at[0]), round(at[1])
    pad = size
    tile = np.zeros((ascent + descent + 2 * pad, width + 2 * pad), np.uint8)
    tile = np.repeat(tile[..., None], 3, axis=2)
    cv2.putText(tile, text, (pad, pad + ascent), (255, 255, 255), font(), size, weight)
    stamp(image, tile[..., 0], (column - pad, row - ascent - pad), colour, halo)


def stamp(image: Image, letters: Mask, corner: tuple[int, int], colour: Rgb, halo: Rgb | None = None) -> None:
    """Blend a mask of letters into the picture, its upper left pixel at `corner` (column, row)."""
    height, width = image.shape[:2]
    left, top = max(corner[0], 0), max(corner[1], 0)
    right, bottom = min(corner[0] + letters.shape[1], width), min(corner[1] + letters.shape[0], height)
    if left >= right or top >= bottom:
        return
    part = letters[top - corner[1] : bottom - corner[1], left - corner[0] : right - corner[0]]
    target = image[top:bottom, left:right].astype(np.float32)
    if halo is not None:
        rim = cv2.GaussianBlur(cv2.dilate(part, np.ones((3, 3), np.uint8)), (0, 0), 1.2)
        weight = np.minimum(rim.astype(np.float32) / 255 * 1.1, 0.85)[..., None]
        target = target * (1 - weight) + np.array(halo, np.float32) * weight
    weight = (part.astype(np.float32) / 255)[..., None]
    image[top:bottom, left:right] = np.round(target * (1 - weight) + np.array(colour, np.float32) * weight)
