"""Quality of images: resolution at edges, noise, defects of the sensor, response to light."""
