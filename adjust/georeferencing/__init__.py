"""Direct georeferencing: points from GNSS, INS and a calibration alone, and their accuracy."""
