"""An adjustment result in a notebook: one line, a page, a table, a picture."""
