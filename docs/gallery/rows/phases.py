import shapephase as sp

cat = sp.load_body("cat_two_halves")
loop = sp.examples.kane_scher(0.0, 1.037)
motion = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.002, 0.005])
ax = motion.plot("phases")
