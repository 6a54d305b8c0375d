shapephase plot energy diver diver_twist \
    --momentum 0 61.558831 0 --out energy.png
