"""What commands say: results as text for people and as plain data for programs, and answers to wrong words."""
