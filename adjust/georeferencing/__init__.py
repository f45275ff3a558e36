"""Direct georeferencing: what GNSS, INS and a calibration give without any control, and how well."""
