"""How good the result is: covariance, redundancy, gross errors, the global test."""
