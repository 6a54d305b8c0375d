"""The commands of `shapephase`: arguments in, tables, JSON, figures and exit codes out; all work is done below."""
