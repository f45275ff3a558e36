"""The frame camera: interior orientation, mounting, collinearity."""
