shapephase rigid 3 6 8 --momentum 0.5 0.3 1 \
    --figure polhodes --out separatrix.png
