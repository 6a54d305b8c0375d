"""The attitude equation in steps: the formula, how many, taken how, and what they are off by."""
