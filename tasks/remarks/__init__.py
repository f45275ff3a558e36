"""Remarks: what the figures and tables of an adjustment mean, in sentences, with what to check."""
