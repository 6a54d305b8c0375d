"""Bodies in formats that other programs own, read by these programs in a process of their own."""
