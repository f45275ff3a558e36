"""The command line: a file per command or family of them; heavy libraries are imported when a command runs."""
