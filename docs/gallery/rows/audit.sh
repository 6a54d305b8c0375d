shapephase audit diver robots/diver_dive.mot --html audit.html
