shapephase plot inertia diver diver_twist --out inertia.png
