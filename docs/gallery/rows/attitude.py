import shapephase as sp

diver = sp.load_body("diver")
twist = sp.examples.MOTIONS["diver_twist"].path()
motion = sp.reconstruct(sp.articulated(diver, twist), [0.0, 61.56, 0.0])
ax = motion.plot("attitude")
