"""What can be said about the parameters of the camera and its system: significance, selection."""
