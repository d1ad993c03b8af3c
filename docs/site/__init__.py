"""What of the documentation is made when it is built: figures, and reference from the code."""
