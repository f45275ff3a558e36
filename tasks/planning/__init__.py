"""Flight planning: what a flight will determine."""
