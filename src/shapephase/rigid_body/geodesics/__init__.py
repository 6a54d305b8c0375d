"""Geodesics of the rigid body's metrics: Serret-Andoyer, surfaces of revolution, ellipsoids, left-invariant on SO(3).

`andoyer_variables`, `serret_andoyer` (with `serret_andoyer_geodesics`), `sadov_variables`; `surface_of_revolution`,
`metric_profile`, `extremal`, `conjugate_locus`, `cut_locus`, `ellipsoid`; `left_invariant`, `axisymmetric_cut`,
`distance`. Mostly after Bonnard, Cots and Shcherbakova 2013.
"""
