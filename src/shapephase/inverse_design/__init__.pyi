from ._family_cover import Cover
from .designing import Design, design

__all__ = ["Cover", "Design", "design"]
