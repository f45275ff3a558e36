"""Foreign files: one reader a format, all returning records with the line each row came from."""
