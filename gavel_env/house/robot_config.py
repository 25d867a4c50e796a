"""The robot and its camera, as one frozen record with units in the names.

The camera is OmniGibson's default sensor (aperture 20.995 mm, focal length 17 mm: 63.4 degrees); radius and reach are
those of docs/explanation/design.md. The paper gives no radius: at 0.35 m many measured doorways close, hence 0.25 m.
"""

from __future__ import annotations

import math

import msgspec

from gavel_env.errors import BadRobotConfig

__all__ = ["DEFAULT_ROBOT", "BadRobotConfig", "RobotConfig"]


class RobotConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Body, reach, camera and search habits of the robot.

    Attributes:
        cell_m: edge of a map cell.
        robot_radius_m: radius of the disc that the floor is eroded by.
        erosion_tolerance_m: clearance that a cell centre may lack, because the true path need not pass the centre
            (half a cell keeps a doorway of 2 * robot_radius_m open wherever the grid falls).
        reach_m: distance to a footprint within which the robot is near it.
        camera_fov_deg: opening angle of the wedge camera.
        camera_range_m: how far it sees.
        camera_every_m: metres driven between two pictures.
        seen_within_m: an object is seen when floor of its room within this distance was seen.
        searched_share: share of a room's floor that must be seen for it to count as searched.
        frontier_min_cells: smaller clusters of unseen floor are looked for only when no larger one is left.
    """

    cell_m: float = 0.1
    robot_radius_m: float = 0.25
    erosion_tolerance_m: float = 0.05
    reach_m: float = 1.5
    camera_fov_deg: float = math.degrees(2.0 * math.atan(20.995 / (2.0 * 17.0)))
    camera_range_m: float = 5.0
    camera_every_m: float = 1.0
    seen_within_m: float = 0.8
    searched_share: float = 0.95
    frontier_min_cells: int = 5

    def __post_init__(self) -> None:
        """Refuse values outside their range.

        Raises:
            BadRobotConfig: names the field, its value and the range.
        """
        for name, low, high in _RANGES:
            value = getattr(self, name)
            if not low <= value <= high:
                raise BadRobotConfig(f"RobotConfig.{name} is {value!r}; it must be between {low:g} and {high:g}")

    @property
    def scan_headings(self) -> int:
        """Number of pictures that cover the full circle."""
        return math.ceil(360.0 / self.camera_fov_deg)


_RANGES: tuple[tuple[str, float, float], ...] = (
    ("cell_m", 0.02, 0.5),
    ("robot_radius_m", 0.0, 1.0),
    ("erosion_tolerance_m", 0.0, 0.25),
    ("reach_m", 0.2, 5.0),
    ("camera_fov_deg", 5.0, 360.0),
    ("camera_range_m", 0.5, 50.0),
    ("camera_every_m", 0.05, 100.0),
    ("seen_within_m", 0.0, 5.0),
    ("searched_share", 0.05, 1.0),
    ("frontier_min_cells", 1, 10_000),
)

DEFAULT_ROBOT = RobotConfig()
