"""Frames of a running episode: the house from above, what was seen of it, the robot and its trail."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gavel_env.house.scenes import Scene
from gavel_env.render import EpisodeView, Marker, RobotPose, ScenePicture, SeenFloor, draw_episode_frame
from gavel_env.sim.episode import Episode

__all__ = ["EpisodeCamera"]

_PIXELS_PER_M = 40.0


@lru_cache(maxsize=4)
def _picture(scene: Scene) -> ScenePicture:
    return ScenePicture(scene, pixels_per_m=_PIXELS_PER_M, caption_lines=3)


class EpisodeCamera:
    """Draws one episode; the picture of the house is drawn once for all episodes in it."""

    def __init__(self, episode: Episode) -> None:
        self._picture = _picture(episode.scene)
        self._layout = episode.layout
        self._trail: list[tuple[float, float]] = [self._layout.point(episode.observed.cell)]

    def follow(self, route: tuple[int, ...]) -> None:
        """Add the cells driven over to the trail."""
        self._trail.extend(self._layout.point(cell) for cell in route[1:])

    def picture(self, episode: Episode) -> NDArray[np.uint8]:
        """Return the episode as it stands, (height, width, 3) uint8 RGB."""
        observed = episode.observed
        graph = observed.graph
        x, y = self._layout.point(observed.cell)
        robot = self._layout.robot
        movables = [o for o, node in graph.world.nodes.items() if not node.fixed and o != graph.holding]
        view = EpisodeView(
            robot=RobotPose(x, y, observed.heading_deg),
            radius_m=robot.robot_radius_m,
            fov_deg=robot.camera_fov_deg,
            held=graph.holding,
            trail=tuple(self._trail),
            markers=tuple(Marker(*observed.positions[o], o) for o in movables),
            seen=SeenFloor(episode.executor.observed.seen, self._layout.origin_m, robot.cell_m),
            caption=(observed.instruction, f"{observed.metres:.1f} m · {observed.outcome or 'start'}"),
        )
        return draw_episode_frame(self._picture, view)
