shapephase explore cat --joints waist_pitch waist_yaw --html explore.html
