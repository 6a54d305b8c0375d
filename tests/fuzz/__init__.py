"""Files damaged at random: each is read as it stands, or refused by an error of the library."""
