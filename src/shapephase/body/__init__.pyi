from .appearance import Visual, inertia_box, visuals
from .body import Body, MovingPart
from .catalog import example_file, example_names, load_body, robot_names, robots_folder
from .joint_chain import JointChain

__all__ = [
    "Body",
    "JointChain",
    "MovingPart",
    "Visual",
    "example_file",
    "example_names",
    "inertia_box",
    "load_body",
    "robot_names",
    "robots_folder",
    "visuals",
]
