"""The contents of a folder of delivered files, and a draft of its project file."""
