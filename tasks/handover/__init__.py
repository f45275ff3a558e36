"""Results for other programs, each converted to the conventions of the receiving program."""
