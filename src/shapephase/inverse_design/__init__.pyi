from ._family_cover import Cover
from .design import Design, design

__all__ = ["Cover", "Design", "design"]
