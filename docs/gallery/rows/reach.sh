shapephase reach cat --out reach.png
