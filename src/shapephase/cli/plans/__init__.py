"""`shapephase plan`: a search for the joint motion that turns a body to a goal."""
