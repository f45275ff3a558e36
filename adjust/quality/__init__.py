"""Quality of the result: covariance, redundancy, gross errors, the global test."""
