from .body import Body, MovingPart
from .catalog import example_file, example_names, robot_names, robots_folder
from .collisions.distances import LinkDistances, link_distances
from .collisions.geometry import CollisionGeometry, collision_geometry
from .couplings.coupling import Coupling
from .drawing.appearance import visuals
from .drawing.visual import Visual, inertia_box
from .family import BodyFamily
from .joint_chain import JointChain
from .loading import load_body
from .particles.point_masses import ParticleBody, particle_body
from .plausibility import implausible

__all__ = [
    "Body",
    "BodyFamily",
    "CollisionGeometry",
    "Coupling",
    "JointChain",
    "LinkDistances",
    "MovingPart",
    "ParticleBody",
    "Visual",
    "collision_geometry",
    "example_file",
    "example_names",
    "implausible",
    "inertia_box",
    "link_distances",
    "load_body",
    "particle_body",
    "robot_names",
    "robots_folder",
    "visuals",
]
