shapephase contributions diver diver_twist \
    --momentum 0 61.558831 0 --html shares.html
