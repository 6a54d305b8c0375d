shapephase split astronaut astronaut_leg_swing \
    --momentum 0.5 2 3 --html split.html
