shapephase plot torques satellite satellite_sweep \
    --momentum 0 0 12 --out torques.png
