shapephase conjugate 3 2 1 --momenta 1.45 1.6 1.7 --out conjugate.png
