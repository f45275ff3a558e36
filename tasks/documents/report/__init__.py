"""The report of an adjustment: one self-contained HTML page, from tables to plots to words."""
