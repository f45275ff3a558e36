"""The certificate of a calibration: one content, written as HTML, PDF and JSON."""
