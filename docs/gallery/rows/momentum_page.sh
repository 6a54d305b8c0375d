shapephase momentum diver robots/diver_dive.mot --html momentum.html
