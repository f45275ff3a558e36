"""Map projections, heights, datums, and the local frame of the adjustment."""
