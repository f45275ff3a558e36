"""image_quality.html: resolution, noise and defects of images."""
