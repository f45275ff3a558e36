"""An adjustment result for people at a keyboard: one line, a page, a table, a picture."""
