shapephase contributions cat cat_righting --of twist --figure shares.png
