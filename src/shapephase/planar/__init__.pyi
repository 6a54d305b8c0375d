from .closed_forms import beanie_turn, square_cat_turn, three_body_turn, two_link_turn, yo_yo_rate, yo_yo_stop

__all__ = [
    "beanie_turn",
    "square_cat_turn",
    "three_body_turn",
    "two_link_turn",
    "yo_yo_rate",
    "yo_yo_stop",
]
