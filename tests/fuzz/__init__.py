"""Fuzzing: files and command lines by grammars, each tried under limits and held against plain readers."""
