"""The free rigid body and its relatives, in closed form where there is one; needs no robot model.

`euler_top` (momentum, attitude, phases), `momentum_orbit` (the momentum's curve), `poinsot` (the rolling ellipsoid),
`portrait` (all polhodes), `stability`, `half_twist` (Dzhanibekov, tennis racket), `euler_angles`, `pendulum`,
`andoyer_pendulum`, `nambu_pair`; `heavy_top`, `lagrange_top`, `nutation`; `lie_algebra`, `lie_poisson`,
`euler_poincare`, `group_kinematics`, `generalised_poinsot`, `n_dimensional_rigid_body`, `lagrangian`, `cayley_klein`,
`magnetic_moment`, `dissipation`. Mostly after Marsden and Ratiu, Introduction to Mechanics and Symmetry, chapter 15.
"""
