"""What tests share: bodies, independent computations, writers of files, a browser."""
