"""Image quality: from image files to edges, noise and defects, and to their tables."""
