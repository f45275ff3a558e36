"""Results for other programs: each is given what its own understanding of the world needs."""
