"""Which parameters a block determines: correlations, significance, elimination."""
