"""What one collocation node contributes to a plan's program."""
