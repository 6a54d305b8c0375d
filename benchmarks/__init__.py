"""Speed and true error, side by side with what people use today: `make bench`."""
