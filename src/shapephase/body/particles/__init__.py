"""Bodies of point masses whose places are a function of a shape."""
