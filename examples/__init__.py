"""Short programs that are the manual and the regression suite at once."""
