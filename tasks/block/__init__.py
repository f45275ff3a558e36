"""Between tables and the mathematics: the block that goes in, the results that come out."""
