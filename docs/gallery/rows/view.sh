shapephase view cat cat_righting --video righting.png
