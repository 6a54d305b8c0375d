shapephase plan cat --turn "180 about x" --html plan.html
