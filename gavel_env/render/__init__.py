"""Pictures of scenes and episodes, drawn with OpenCV alone.

Import this package where a picture is wanted, not before: it loads OpenCV.
"""

from gavel_env.render.episode import EpisodeView, Marker, RobotPose, SeenFloor, draw_episode_frame
from gavel_env.render.picture import ScenePicture, draw_scene, save_png

__all__ = [
    "EpisodeView",
    "Marker",
    "RobotPose",
    "ScenePicture",
    "SeenFloor",
    "draw_episode_frame",
    "draw_scene",
    "save_png",
]
