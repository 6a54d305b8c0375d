"""Speed and true error, side by side with compiled C++ and with what people use today: `make bench`."""
