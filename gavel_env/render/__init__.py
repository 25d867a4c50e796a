"""Pictures of scenes and episodes, drawn with OpenCV alone.

Import this package where a picture is wanted, not before: it loads OpenCV.
"""

from gavel_env.render.picture import ScenePicture, draw_scene

__all__ = ["ScenePicture", "draw_scene"]
