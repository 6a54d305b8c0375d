from .appearance import Visual, inertia_box, visuals
from .body import Body, MovingPart
from .catalog import example_file, example_folder, example_names, load_body, load_from_input, robot_names, robots_folder

__all__ = [
    "Body",
    "MovingPart",
    "Visual",
    "example_file",
    "example_folder",
    "example_names",
    "inertia_box",
    "load_body",
    "load_from_input",
    "robot_names",
    "robots_folder",
    "visuals",
]
