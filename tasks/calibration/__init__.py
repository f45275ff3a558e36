"""What a calibration says as a document: the record, its verdicts, certificate and registry build on it."""
