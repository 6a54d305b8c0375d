"""Recorded paths: polynomials between many knots, sampled on panels that span several of them."""
