"""Kinds of files of motions, and tables in memory: each reader makes a `Table` of what it is given."""
