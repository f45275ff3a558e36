"""File formats: one reader per format, all returning records with the line of each row."""
