"""The command line: one file per command or family; heavy libraries are imported when a command runs."""
