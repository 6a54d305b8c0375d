"""What may stand where a number or a name is meant, in files and on command lines."""

ODD_WORDS = (
    *("", " ", "--", "nan", "inf", "-1", "0", "1e400", "1e-320", "1e308", "1e5", "1e-9", "1,5", "1 2 3", "0x10"),
    *("x" * 300, "\u202e", "&", "${x}"),
)
"""Words that are no number, numbers that are too large, too small or of the wrong sign, and names that are none."""
ODD_NUMBERS = (float("nan"), float("inf"), -float("inf"), 1e7, 1e300, 5e-324, -1e308)
"""What stands in an array of numbers."""
