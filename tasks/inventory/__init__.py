"""What lies in a folder of delivered files, and the project file that begins with it."""
