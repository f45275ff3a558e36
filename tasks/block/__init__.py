"""Interface between tables and mathematics: the input block and the results."""
