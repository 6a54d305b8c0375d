shapephase rigid 1 2 3 --momentum 0.6 0.9 0.5 --html rolling.html
