from .assemblies import assembly, boom, moving_mass, rigid_part
from .assembly_parts import Boom, MovingMass, Part, RigidPart
from .deformation import Deformation, DeformationFamily, articulated, particles, prescribed, rigid
from .descriptions import Description
from .gauge import horizontal_gauge, in_gauge, link_gauge, mean_body_gauge, named_gauge, principal_gauge

__all__ = [
    "Boom",
    "Deformation",
    "DeformationFamily",
    "Description",
    "MovingMass",
    "Part",
    "RigidPart",
    "articulated",
    "assembly",
    "boom",
    "horizontal_gauge",
    "in_gauge",
    "link_gauge",
    "mean_body_gauge",
    "moving_mass",
    "named_gauge",
    "particles",
    "prescribed",
    "principal_gauge",
    "rigid",
    "rigid_part",
]
