"""From delivered files to tables in the frame and units of the project."""
