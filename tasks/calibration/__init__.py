"""The record of a calibration and its verdicts, on which certificate and registry are based."""
